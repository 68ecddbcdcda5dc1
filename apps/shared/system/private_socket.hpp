// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/error.hpp>
#include <boost/system/error_code.hpp>
#include <boost/system/system_error.hpp>

#include <cerrno>

#include <sys/socket.h>
#include <unistd.h>

namespace tool {

/// Gives a socket of Asio a descriptor, or closes that.
template <class Socket>
void assign_owned(Socket& to, const typename Socket::protocol_type& how, int descriptor,
                  boost::system::error_code& code) {
    if (descriptor < 0) {
        code.assign(errno, boost::system::system_category());
        return;
    }
    to.assign(how, descriptor, code);
    if (code) {
        ::close(descriptor);
    }
}

/// Opens a socket of Asio that programs started by this one do not inherit. Asio opens and accepts sockets without
/// close-on-exec; if that is set afterwards, another thread may start a program in between.
template <class Socket>
void open_private(Socket& socket, const typename Socket::protocol_type& how, boost::system::error_code& code) {
    assign_owned(socket, how, ::socket(how.family(), how.type() | SOCK_CLOEXEC, how.protocol()), code);
}
/// \throws boost::system::system_error
template <class Socket>
void open_private(Socket& socket, const typename Socket::protocol_type& how) {
    boost::system::error_code code;
    open_private(socket, how, code);
    if (code) {
        throw boost::system::system_error{code};
    }
}

/// Accepts a connection that waits; `try_again` if there is none, any more. \pre the acceptor is non-blocking
template <class Acceptor, class Socket>
void accept_private(Acceptor& from, const typename Socket::protocol_type& how, Socket& to,
                    boost::system::error_code& code) {
    assign_owned(to, how, ::accept4(from.native_handle(), nullptr, nullptr, SOCK_CLOEXEC), code);
    using namespace boost::system::errc;
    if (code == resource_unavailable_try_again || code == connection_aborted || code == protocol_error) {
        code = boost::asio::error::try_again;
    }
}

} // namespace tool
