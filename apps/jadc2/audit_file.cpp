// SPDX-License-Identifier: BSL-1.0
#include "audit_file.hpp"

#include <cerrno>
#include <stdexcept>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

namespace jadc2 {

audit_file::audit_file(const std::string& path)
    : file_(::open(path.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600)) {
    if (file_ < 0) {
        throw std::runtime_error("cannot open " + path + ": " +
                                 std::error_code{errno, std::generic_category()}.message());
    }
}

audit_file::~audit_file() { ::close(file_); }

void audit_file::add(const std::string& line) {
    if (!broken_) {
        const auto written = ::write(file_, line.data(), line.size());
        broken_ = written != static_cast<ssize_t>(line.size()) || ::fdatasync(file_) != 0;
    }
}

} // namespace jadc2
