// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/vehicle_networks.hpp"

#include <cles/error.hpp>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>
#include <string_view>
#include <system_error>

#include <arpa/inet.h>
#include <fcntl.h>
#include <linux/if_tun.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

namespace platoon {
namespace {

constexpr std::uint32_t first_address = 0x0A530000; // 10.83.0.0
constexpr std::uint32_t network_mask = 0xFFFFFF00;

/// What failed, for the parent of the process that created a network.
struct failure {
    std::array<char, 48> what{};
    int why = 0;
};

[[noreturn]] void throw_failure(const failure& of) {
    throw cles::error(cles::errc::no_target, "faults need a network namespace for each vehicle, and " +
                                                 std::string{of.what.data()} + ": " +
                                                 std::generic_category().message(of.why));
}

failure failed(const char* what) {
    failure out{.why = errno};
    std::snprintf(out.what.data(), out.what.size(), "%s", what);
    return out;
}

bool set_address(int socket, const char* device, unsigned long request, std::uint32_t address) {
    ifreq what{};
    std::string_view{device}.copy(what.ifr_name, sizeof what.ifr_name - 1);
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = ::htonl(address);
    std::memcpy(&what.ifr_addr, &to, sizeof to);
    return ::ioctl(socket, request, &what) == 0;
}

bool set_up(int socket, const char* device) {
    ifreq what{};
    std::string_view{device}.copy(what.ifr_name, sizeof what.ifr_name - 1);
    if (::ioctl(socket, SIOCGIFFLAGS, &what) != 0) {
        return false;
    }
    what.ifr_flags = static_cast<short>(what.ifr_flags | IFF_UP | IFF_MULTICAST);
    return ::ioctl(socket, SIOCSIFFLAGS, &what) == 0;
}

/// Enters a new network, and creates its device. \return its descriptor; -1: it failed
int create_device(unsigned number, failure& why) {
    if (::unshare(CLONE_NEWNET) != 0) {
        why = failed("this process may not create it");
        return -1;
    }
    const int device = ::open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC);
    ifreq what{};
    std::string_view{radio_device}.copy(what.ifr_name, sizeof what.ifr_name - 1);
    what.ifr_flags = IFF_TUN | IFF_NO_PI;
    if (device < 0 || ::ioctl(device, TUNSETIFF, &what) != 0) {
        why = failed("/dev/net/tun is not available");
        return -1;
    }
    const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (socket < 0 || !set_up(socket, "lo") ||
        !set_address(socket, radio_device, SIOCSIFADDR, first_address + number) ||
        !set_address(socket, radio_device, SIOCSIFNETMASK, network_mask) || !set_up(socket, radio_device)) {
        why = failed("its device cannot be configured");
        return -1;
    }
    return device;
}

/// Sends descriptors, or without them what failed.
void send(int to, const failure& what, const std::array<int, 2>* descriptors) {
    auto copy = what;
    iovec part{.iov_base = &copy, .iov_len = sizeof copy};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int) * 2)> space{};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    if (descriptors != nullptr) {
        message.msg_control = space.data();
        message.msg_controllen = space.size();
        auto* const head = CMSG_FIRSTHDR(&message);
        head->cmsg_level = SOL_SOCKET;
        head->cmsg_type = SCM_RIGHTS;
        head->cmsg_len = CMSG_LEN(sizeof *descriptors);
        std::memcpy(CMSG_DATA(head), descriptors->data(), sizeof *descriptors);
    }
    static_cast<void>(::sendmsg(to, &message, MSG_NOSIGNAL));
}

/// \return whether there were descriptors
bool receive(int from, failure& what, std::array<int, 2>& descriptors) {
    iovec part{.iov_base = &what, .iov_len = sizeof what};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int) * 2)> space{};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = space.data();
    message.msg_controllen = space.size();
    ssize_t size = 0;
    do {
        size = ::recvmsg(from, &message, MSG_CMSG_CLOEXEC);
    } while (size < 0 && errno == EINTR);
    if (size != static_cast<ssize_t>(sizeof what)) {
        errno = size < 0 ? errno : ECONNRESET;
        what = failed("the process that creates it has ended");
        return false;
    }
    const auto* const head = CMSG_FIRSTHDR(&message);
    if (head == nullptr || head->cmsg_len != CMSG_LEN(sizeof descriptors)) {
        if (what.why == 0) { // they were sent
            errno = EMFILE;
            what = failed("it cannot be received");
        }
        return false;
    }
    std::memcpy(descriptors.data(), CMSG_DATA(head), sizeof descriptors);
    return true;
}

// In a process of its own, because this one stays in its network.
bool create_network(unsigned number, failure& why, std::array<int, 2>& descriptors) {
    std::array<int, 2> pair{};
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair.data()) != 0) {
        why = failed("a process for it cannot be started");
        return false;
    }
    const pid_t creator = ::fork();
    if (creator == 0) {
        failure trouble;
        std::array<int, 2> made{-1, create_device(number, trouble)};
        if (made[1] >= 0) {
            made[0] = ::open("/proc/self/ns/net", O_RDONLY | O_CLOEXEC);
            trouble = made[0] >= 0 ? trouble : failed("it cannot be opened");
        }
        send(pair[1], trouble, made[0] >= 0 ? &made : nullptr);
        ::_exit(0);
    }
    ::close(pair[1]);
    if (creator < 0) {
        why = failed("a process for it cannot be started");
    }
    const bool received = creator > 0 && receive(pair[0], why, descriptors);
    ::close(pair[0]);
    while (creator > 0 && ::waitpid(creator, nullptr, 0) < 0 && errno == EINTR) {
    }
    return received;
}

bool write_file(const char* path, const std::string& text) {
    const int file = ::open(path, O_WRONLY | O_CLOEXEC);
    if (file < 0) {
        return false;
    }
    const bool written = ::write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
    ::close(file);
    return written;
}

// With the same user, so that files belong to it as before.
void enter_user_namespace() {
    const auto user = std::to_string(::geteuid());
    const auto group = std::to_string(::getegid());
    if (::unshare(CLONE_NEWUSER) != 0) {
        throw_failure(failed("this user may not create a user namespace"));
    }
    if (!write_file("/proc/self/setgroups", "deny") || !write_file("/proc/self/uid_map", user + " " + user + " 1") ||
        !write_file("/proc/self/gid_map", group + " " + group + " 1")) {
        throw_failure(failed("a user namespace cannot be set up"));
    }
}

} // namespace

vehicle_networks::vehicle_networks(std::size_t vehicles) {
    bool entered = ::geteuid() != 0;
    if (entered) {
        enter_user_namespace();
    }
    while (all_.size() < vehicles) {
        failure why;
        std::array<int, 2> made{};
        if (create_network(host_number(all_.size()), why, made)) {
            all_.push_back({.network = made[0], .device = made[1]});
        } else if (!entered && why.why == EPERM) { // root without the right to it
            entered = true;
            enter_user_namespace();
        } else {
            close();
            throw_failure(why);
        }
    }
}

vehicle_networks::~vehicle_networks() { close(); }

void vehicle_networks::close() noexcept {
    for (const auto& each : all_) {
        ::close(each.network);
        ::close(each.device);
    }
    all_.clear();
}

std::vector<int> vehicle_networks::devices() const {
    std::vector<int> out;
    out.reserve(all_.size());
    for (const auto& each : all_) {
        out.push_back(each.device);
    }
    return out;
}

} // namespace platoon
