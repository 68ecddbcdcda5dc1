// SPDX-License-Identifier: BSL-1.0
#include <cles/wake_bound.hpp>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <limits>
#include <string>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

namespace cles {
namespace {

using written_microseconds = std::int32_t; // in the host's byte order

constexpr const char* path = "/dev/cpu_dma_latency";

[[noreturn]] void refuse(int why) {
    throw std::system_error(why, std::generic_category(),
                            std::string{"limiting the wake-up time of cores (it needs write access to "} + path + ")");
}

} // namespace

wake_bound::wake_bound(std::chrono::microseconds longest) : device_(::open(path, O_WRONLY | O_CLOEXEC)) {
    if (device_ < 0) {
        refuse(errno);
    }
    constexpr std::chrono::microseconds most{std::numeric_limits<written_microseconds>::max()};
    const auto value =
        static_cast<written_microseconds>(std::clamp(longest, std::chrono::microseconds{0}, most).count());
    if (::write(device_, &value, sizeof value) != sizeof value) {
        const auto why = errno;
        ::close(device_);
        refuse(why);
    }
}

wake_bound::~wake_bound() { ::close(device_); }

} // namespace cles
