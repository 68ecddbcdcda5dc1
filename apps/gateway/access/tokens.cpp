// SPDX-License-Identifier: BSL-1.0
#include "gateway/access/tokens.hpp"

#include <cles/security/checked_file.hpp>

#include "gateway/http/message.hpp"
#include "system/whole_file.hpp"

#include <openssl/evp.h>
#include <openssl/rand.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace gateway {
namespace {

constexpr std::size_t most_tokens = 4096;
constexpr std::size_t longest_file = 1U << 20U;
constexpr std::size_t hash_digits = 64;

[[noreturn]] void fail_at(const std::string& place, const std::string& why) {
    throw std::runtime_error(place + ": " + why);
}

std::string system_reason() { return std::generic_category().message(errno); }

std::string hex_of(std::span<const unsigned char> bytes) {
    constexpr std::string_view digits = "0123456789abcdef";
    std::string out;
    for (const auto byte : bytes) {
        out.push_back(digits[byte >> 4U]);
        out.push_back(digits[byte & 15U]);
    }
    return out;
}

} // namespace

token_table token_table::read(std::string_view text) {
    token_table made;
    for (std::size_t number = 1; !text.empty(); ++number) {
        auto line = take_part(text, '\n');
        line = trimmed(line.substr(0, line.find('#')));
        if (line.empty()) {
            continue;
        }
        const auto name = take_part(line, ' ');
        const auto hash = trimmed(line);
        const auto where = "line " + std::to_string(number);
        if (hash.size() != hash_digits || hash.find_first_not_of("0123456789abcdef") != std::string_view::npos) {
            fail_at(where, "write the name of a member, a space, and the SHA-256 of its token");
        }
        if (made.names_.size() == most_tokens) {
            fail_at(where, "there are more than 4096 tokens");
        }
        if (!made.names_.emplace(hash, name).second) {
            fail_at(where, "the token is in the file already");
        }
    }
    return made;
}

std::string_view token_table::name_of(std::string_view hash) const {
    const auto found = names_.find(hash);
    return found == names_.end() ? std::string_view{} : std::string_view{found->second};
}

std::string token_file::state() const {
    struct stat found {};
    if (::stat(path_.c_str(), &found) != 0) {
        return "none";
    }
    std::string out;
    for (const auto part : {static_cast<std::int64_t>(found.st_ino), static_cast<std::int64_t>(found.st_size),
                            static_cast<std::int64_t>(found.st_mode), static_cast<std::int64_t>(found.st_mtim.tv_sec),
                            static_cast<std::int64_t>(found.st_mtim.tv_nsec)}) {
        out.append(std::to_string(part)).append(" ");
    }
    return out;
}

std::optional<token_table> token_file::read_if_changed() {
    auto now = state();
    if (now == last_) {
        return std::nullopt;
    }
    last_ = std::move(now);
    const cles::security::checked_file file{path_};
    struct stat found {};
    if (!file.flaw().empty()) {
        throw std::runtime_error(file.flaw());
    }
    if (::fstat(file.descriptor(), &found) != 0) {
        fail_at(path_, system_reason());
    }
    if ((found.st_mode & 077U) != 0) {
        fail_at(path_, "others may read it: run chmod 600 " + path_);
    }
    std::string text;
    if (const auto why = tool::read_open_file(file.descriptor(), text, longest_file)) {
        fail_at(path_, why.message());
    }
    if (text.size() == longest_file) {
        fail_at(path_, "it is longer than 1 MiB");
    }
    try {
        return token_table::read(text);
    } catch (const std::runtime_error& e) {
        fail_at(path_, e.what());
    }
}

std::string token_file::add(const std::string& name) {
    auto token = random_text();
    auto line = name + " " + sha256_of(token) + "\n";
    const int descriptor = ::open(path_.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (descriptor < 0) {
        fail_at(path_, system_reason());
    }
    char last = '\n';
    const auto end = ::lseek(descriptor, 0, SEEK_END);
    if (end > 0 && ::pread(descriptor, &last, 1, end - 1) == 1 && last != '\n') { // as some editors leave it
        line.insert(0, "\n");
    }
    const auto written = ::write(descriptor, line.data(), line.size());
    const auto why = system_reason();
    if (::close(descriptor) != 0 || written != static_cast<ssize_t>(line.size())) {
        fail_at(path_, why);
    }
    return token;
}

std::string sha256_of(std::string_view text) {
    std::array<unsigned char, EVP_MAX_MD_SIZE> bytes{};
    unsigned int size = 0;
    if (EVP_Digest(text.data(), text.size(), bytes.data(), &size, EVP_sha256(), nullptr) != 1) {
        throw std::runtime_error("SHA-256 is not available");
    }
    return hex_of({bytes.data(), size});
}

std::string random_text() {
    std::array<unsigned char, 32> bytes{};
    if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1) {
        throw std::runtime_error("no random numbers are available");
    }
    return hex_of(bytes);
}

} // namespace gateway
