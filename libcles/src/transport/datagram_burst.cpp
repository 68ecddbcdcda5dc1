// SPDX-License-Identifier: BSL-1.0
#include "transport/datagram_burst.hpp"

#include <array>
#include <cerrno>

#include <sys/socket.h>

namespace cles::transport {
namespace {

constexpr std::size_t most = 32;

} // namespace

lines_done send_burst(boost::asio::ip::udp::socket& socket, std::string_view lines) noexcept {
    std::array<iovec, most> texts;     // NOLINT(cppcoreguidelines-pro-type-member-init): as far as it is used
    std::array<mmsghdr, most> headers; // NOLINT(cppcoreguidelines-pro-type-member-init): the same
    unsigned count = 0;
    for (auto rest = lines; !rest.empty() && count < most; ++count) {
        const auto line = rest.substr(0, rest.find('\n') + 1);
        rest.remove_prefix(line.size());
        texts[count] = {.iov_base = const_cast<char*>(line.data()), .iov_len = line.size()};
        headers[count] = {};
        headers[count].msg_hdr.msg_iov = &texts[count];
        headers[count].msg_hdr.msg_iovlen = 1;
    }
    const auto sent = ::sendmmsg(socket.native_handle(), headers.data(), count, MSG_DONTWAIT);
    if (sent < 0) {
        return errno == EAGAIN ? lines_done{} : lines_done{.lines = 1, .bytes = texts[0].iov_len};
    }
    lines_done done{.lines = static_cast<std::size_t>(sent)};
    for (std::size_t i = 0; i < done.lines; ++i) {
        done.bytes += texts[i].iov_len;
    }
    return done;
}

} // namespace cles::transport
