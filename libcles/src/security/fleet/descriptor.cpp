// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/descriptor.hpp"

#include "security/keys/keys.hpp"

#include <cerrno>
#include <system_error>
#include <utility>

#include <sys/stat.h>
#include <unistd.h>

namespace cles::security {

descriptor::descriptor(descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}

descriptor& descriptor::operator=(descriptor&& other) noexcept {
    descriptor closed{std::exchange(fd_, std::exchange(other.fd_, -1))};
    return *this;
}

int descriptor::release() noexcept { return std::exchange(fd_, -1); }

descriptor::~descriptor() {
    if (is_open()) {
        close(fd_);
    }
}

void fail_with(int code, const std::string& what) {
    throw security_error{what + ": " + std::generic_category().message(code)};
}

struct stat status_of(const descriptor& file, const std::string& path) {
    struct stat status {};
    if (fstat(file.get(), &status) != 0) {
        fail_with(errno, "cannot examine " + path);
    }
    return status;
}

} // namespace cles::security
