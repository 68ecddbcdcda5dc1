// SPDX-License-Identifier: BSL-1.0
#include "transport/private_socket.hpp"

#include <cerrno>

#include <sys/socket.h>
#include <unistd.h>

namespace cles::transport {

int new_descriptor(int family, int type, int protocol, boost::system::error_code& code) noexcept {
    const int made = ::socket(family, type | SOCK_CLOEXEC, protocol);
    if (made < 0) {
        code.assign(errno, boost::system::system_category());
    } else {
        code.clear();
    }
    return made;
}

void close_descriptor(int descriptor) noexcept { ::close(descriptor); }

void accept_private(listening_socket& from, const boost::asio::generic::stream_protocol& how, stream_socket& to,
                    boost::system::error_code& code) {
    const int made = ::accept4(from.native_handle(), nullptr, nullptr, SOCK_CLOEXEC);
    if (made < 0) {
        code.assign(errno, boost::system::system_category());
        return;
    }
    to.assign(how, made, code);
    if (code) {
        close_descriptor(made);
    }
}

} // namespace cles::transport
