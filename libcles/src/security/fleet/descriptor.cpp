// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/descriptor.hpp"

#include <utility>

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

} // namespace cles::security
