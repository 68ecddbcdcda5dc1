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

using microseconds_told = std::int32_t; // in the host's byte order

constexpr const char* path = "/dev/cpu_dma_latency";

[[noreturn]] void refuse(int why) {
    throw std::system_error(why, std::generic_category(),
                            std::string{"bounding the time that a core takes to wake (it needs "} + path +
                                " and the right to write to it)");
}

} // namespace

wake_bound::wake_bound(std::chrono::microseconds longest) : device_(::open(path, O_WRONLY | O_CLOEXEC)) {
    if (device_ < 0) {
        refuse(errno);
    }
    constexpr std::chrono::microseconds most{std::numeric_limits<microseconds_told>::max()};
    const auto told = static_cast<microseconds_told>(std::clamp(longest, std::chrono::microseconds{0}, most).count());
    if (::write(device_, &told, sizeof told) != sizeof told) {
        const auto why = errno;
        ::close(device_);
        refuse(why);
    }
}

wake_bound::~wake_bound() { ::close(device_); }

} // namespace cles
