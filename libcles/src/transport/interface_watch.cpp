// SPDX-License-Identifier: BSL-1.0
#include "transport/interface_watch.hpp"

#include "transport/member_handler.hpp"
#include "transport/netlink_message.hpp"
#include "transport/private_socket.hpp"

#include <boost/system/system_error.hpp>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include <sys/socket.h>

namespace cles::transport {
namespace asio = boost::asio;

namespace {

// Of netlink(7), as in netlink_message.hpp.
struct netlink_address {
    sa_family_t family = AF_NETLINK;
    std::uint16_t unused = 0;
    std::uint32_t port = 0; // 0: the system
    std::uint32_t groups = 0;
};
static_assert(sizeof(netlink_address) == 12);
constexpr int route_protocol = 0;
constexpr std::uint32_t group_of_links = 0x1;
constexpr std::uint32_t group_of_ipv4_addresses = 0x10;

// A descriptor to which the system reports the changes from now on.
int open_reports() {
    boost::system::error_code code;
    const int made = new_descriptor(AF_NETLINK, SOCK_RAW, route_protocol, code);
    if (code) {
        throw boost::system::system_error{code};
    }
    const netlink_address own{.groups = group_of_links | group_of_ipv4_addresses};
    if (::bind(made, reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0) {
        code.assign(errno, boost::system::system_category());
        close_descriptor(made);
        throw boost::system::system_error{code};
    }
    return made;
}

} // namespace

interface_watch::interface_watch(const asio::any_io_executor& executor, std::function<void()> on_change)
    : reports_(executor, open_reports()), on_change_(std::move(on_change)) {}

void interface_watch::stop() {
    on_change_ = nullptr;
    boost::system::error_code ignored;
    reports_.close(ignored);
}

void interface_watch::wait() {
    wait_call<&interface_watch::on_readable>(reports_, asio::posix::descriptor_base::wait_read, shared_from_this());
}

void interface_watch::on_readable(boost::system::error_code code) {
    if (code || !on_change_) {
        return;
    }
    const bool may_have_changed = read_reports();
    wait();
    if (may_have_changed) {
        on_change_();
    }
}

// Reads a number of reports, so that a host whose interfaces never rest does not keep other tasks from running.
bool interface_watch::read_reports() {
    constexpr int most = 64;
    bool may_have_changed = false;
    std::array<std::byte, 8192> buffer; // NOLINT(cppcoreguidelines-pro-type-member-init): only what is read is used
    for (int count = 0; count < most; ++count) {
        netlink_address from;
        iovec place{.iov_base = buffer.data(), .iov_len = buffer.size()};
        msghdr message{};
        message.msg_name = &from;
        message.msg_namelen = sizeof from;
        message.msg_iov = &place;
        message.msg_iovlen = 1;
        const auto size = ::recvmsg(reports_.native_handle(), &message, MSG_DONTWAIT);
        if (size < 0) {
            if (errno == EINTR) {
                continue;
            }
            // ENOBUFS: reports were lost.
            return may_have_changed || errno == ENOBUFS;
        }
        if (message.msg_namelen != sizeof from || from.port != 0) { // not from the system
            continue;
        }
        const std::span<const std::byte> read{buffer.data(), static_cast<std::size_t>(size)};
        may_have_changed = may_have_changed || (message.msg_flags & MSG_TRUNC) != 0 || may_report_interface(read);
    }
    return may_have_changed;
}

} // namespace cles::transport
