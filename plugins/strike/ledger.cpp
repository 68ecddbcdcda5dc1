// SPDX-License-Identifier: BSL-1.0
#include "ledger.hpp"

#include <cles/convert.hpp>

#include <array>
#include <cerrno>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

namespace strike {
namespace {

[[noreturn]] void fail(const std::string& what) {
    throw std::runtime_error(what + ": " + std::error_code{errno, std::generic_category()}.message());
}

std::string content_of(int file) {
    std::string out;
    std::array<char, 16'384> part{};
    while (true) {
        const auto size = ::read(file, part.data(), part.size());
        if (size < 0 && errno != EINTR) {
            fail("cannot read the ledger");
        }
        if (size == 0) {
            return out;
        }
        if (size > 0) {
            out.append(part.data(), static_cast<std::size_t>(size));
        }
    }
}

} // namespace

ledger::ledger(const std::string& path) : file_(::open(path.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, 0600)) {
    if (file_ < 0) {
        fail("cannot open the ledger");
    }
    try {
        read();
    } catch (...) {
        ::close(file_);
        throw;
    }
}

ledger::~ledger() { ::close(file_); }

void ledger::read() {
    if (::flock(file_, LOCK_EX | LOCK_NB) != 0) {
        fail("the ledger is in use");
    }
    const auto text = content_of(file_);
    std::size_t begin = 0;
    for (auto end = text.find('\n'); end != std::string::npos; end = text.find('\n', begin)) {
        ledger_entry entry;
        std::string why;
        if (!cles::from_json(std::string_view{text}.substr(begin, end - begin), entry, &why)) {
            throw std::runtime_error("line " + std::to_string(before_.size() + 1) + " of the ledger: " + why);
        }
        before_.push_back(std::move(entry));
        begin = end + 1;
    }
    if (begin != text.size() && ::ftruncate(file_, static_cast<off_t>(begin)) != 0) {
        fail("cannot change the ledger");
    }
}

void ledger::add(const ledger_entry& entry) {
    const auto line = cles::to_json(entry) + "\n";
    const auto end = ::lseek(file_, 0, SEEK_END);
    errno = ENOSPC; // what it means if only a part is written, which sets no error
    const auto written = ::write(file_, line.data(), line.size());
    if (written != static_cast<ssize_t>(line.size()) || ::fdatasync(file_) != 0) {
        const auto why = std::error_code{errno, std::generic_category()}.message();
        if (::ftruncate(file_, end) != 0) {
            fail("cannot repair the ledger");
        }
        throw std::runtime_error("cannot write to the ledger: " + why);
    }
}

} // namespace strike
