// SPDX-License-Identifier: BSL-1.0
#include "tap_device.hpp"

#include <stdexcept>

#include <fcntl.h>
#include <linux/if_tun.h>
#include <net/if.h>
#include <sys/ioctl.h>

namespace cles::perf {

descriptor make_tap(const std::string& name) {
    ifreq request{};
    if (name.empty() || name.size() >= sizeof request.ifr_name) {
        throw std::runtime_error("'" + name + "' is no name of a network device");
    }
    descriptor device{checked(::open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC), "/dev/net/tun")};
    request.ifr_flags = static_cast<short>(IFF_TAP | IFF_NO_PI | IFF_TUN_EXCL);
    name.copy(request.ifr_name, name.size());
    checked(::ioctl(device.get(), TUNSETIFF, &request), name.c_str());
    return device;
}

} // namespace cles::perf
