// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/basic_socket_acceptor.hpp>
#include <boost/asio/generic/stream_protocol.hpp>
#include <boost/system/error_code.hpp>
#include <boost/system/system_error.hpp>

#include <utility>

/// Sockets that programs started by this process do not inherit. A child that held one would keep its port taken after
/// the end of this process, and would keep its connections alive, so that no peer notices the loss.
///
/// Asio opens and accepts sockets without close-on-exec. Setting it afterwards leaves a moment in which another thread
/// may fork. So the transports open and accept all of theirs here.

namespace cles::transport {

using stream_socket = boost::asio::generic::stream_protocol::socket;
using listening_socket = boost::asio::basic_socket_acceptor<boost::asio::generic::stream_protocol>;

/// An owned descriptor, as socket(2) returns it.
int new_descriptor(int family, int type, int protocol, boost::system::error_code& code) noexcept;
void close_descriptor(int descriptor) noexcept;

/// Opens a socket of Asio, or sets `code`.
template <class Socket>
void open_private(Socket& socket, const typename Socket::protocol_type& how, boost::system::error_code& code) {
    const int made = new_descriptor(how.family(), how.type(), how.protocol(), code);
    if (!code) {
        socket.assign(how, made, code);
        if (code) {
            close_descriptor(made);
        }
    }
}

/// An open socket of Asio. \throws boost::system::system_error
template <class Socket>
Socket make_private(const typename Socket::executor_type& executor, const typename Socket::protocol_type& how) {
    Socket made{executor};
    boost::system::error_code code;
    open_private(made, how, code);
    if (code) {
        throw boost::system::system_error{code};
    }
    return made;
}

/// Accepts a connection that waits, if there is one; otherwise `code` is `would_block`. \pre the acceptor is open and
/// non-blocking, and `how` its protocol
void accept_private(listening_socket& from, const boost::asio::generic::stream_protocol& how, stream_socket& to,
                    boost::system::error_code& code);

} // namespace cles::transport
