// SPDX-License-Identifier: BSL-1.0
#include "transport/host_lookup.hpp"
#include "transport/ip_host.hpp"
#include "transport/stream_endpoint.hpp"
#include "transport/transports.hpp"

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/v6_only.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

namespace cles::transport {
namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

namespace {

// No delay, and how soon a peer is lost: whose host has been gone or unreachable for `limits::stall`, whether data is
// in transit to it or not. Accepted sockets inherit this from the listening one (Linux), so that a connection of a
// stranger costs no further system calls.
void set_options(int socket, const limits& bounds) {
    constexpr int least = 6; // seconds
    constexpr int most = 3600;
    const auto wanted = std::chrono::duration_cast<std::chrono::seconds>(bounds.stall).count();
    const int seconds = static_cast<int>(std::clamp<decltype(wanted)>(wanted, least, most));
    const auto set = [socket](int level, int option, int value) {
        static_cast<void>(::setsockopt(socket, level, option, &value, sizeof value));
    };
    set(IPPROTO_TCP, TCP_NODELAY, 1);
    set(IPPROTO_TCP, TCP_USER_TIMEOUT, seconds * 1000);
    set(IPPROTO_TCP, TCP_KEEPIDLE, seconds / 2);
    set(IPPROTO_TCP, TCP_KEEPINTVL, seconds / 6);
    set(IPPROTO_TCP, TCP_KEEPCNT, 3);
    set(SOL_SOCKET, SO_KEEPALIVE, 1);
}

tcp::endpoint ip_endpoint(const stream_address& any) {
    tcp::endpoint end;
    std::memcpy(end.data(), any.data(), any.size());
    end.resize(any.size());
    return end;
}

// Sets the traffic class of a connected socket, too.
identity identify(stream_socket& connected, const url& where) {
    error_code ignored;
    set_traffic_class(connected.native_handle(), where, ignored);
    error_code gone;
    const auto peer = connected.remote_endpoint(gone);
    return gone ? identity{.transport = where.scheme, .address = {}, .name = {}, .uid = {}}
                : identity_at(where.scheme, ip_endpoint(peer));
}

class tcp_transport final : public link_transport {
  public:
    [[nodiscard]] bool is_exposed(const url& where) const override { return is_beyond_loopback(where); }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where,
                                     const limits& bounds) override {
        return listen_tcp(executor, where, bounds);
    }

    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        return dial_tcp(executor, where, bounds, std::move(done));
    }
};

} // namespace

std::unique_ptr<acceptor> listen_tcp(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                                     codec_maker make_codec) {
    const tcp::endpoint endpoint{resolve(where), where.port};
    auto socket = make_private<listening_socket>(executor, endpoint.protocol());
    socket.set_option(asio::socket_base::reuse_address{true});
    if (endpoint.address().is_v6()) {
        socket.set_option(asio::ip::v6_only{true});
    }
    set_options(socket.native_handle(), bounds);
    socket.bind(endpoint);
    socket.listen();
    auto local = url_of(where.scheme, ip_endpoint(socket.local_endpoint()));
    return handle_of(std::make_shared<stream_acceptor>(
        std::move(socket), std::move(local), bounds,
        [where](stream_socket& accepted) { return identify(accepted, where); }, std::move(make_codec)));
}

std::function<void()> dial_tcp(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done, codec_maker make_codec) {
    const auto dialler = std::make_shared<stream_dialler>(
        executor, bounds,
        [where, bounds](stream_socket& made) {
            set_options(made.native_handle(), bounds);
            return identify(made, where);
        },
        std::move(done), std::move(make_codec));
    const auto lookup = std::make_shared<host_lookup>(executor, where);
    const auto connect = [dialler, port = where.port,
                          weak = std::weak_ptr{lookup}](const std::vector<asio::ip::address>& found) {
        std::vector<stream_address> endpoints;
        endpoints.reserve(found.size());
        for (const auto& address : found) {
            endpoints.emplace_back(tcp::endpoint{address, port});
        }
        dialler->start(std::move(endpoints), [found, weak](std::size_t which) {
            if (const auto by = weak.lock()) {
                by->prefer(found[which]);
            }
        });
    };
    if (const auto literal = literal_address(where)) {
        connect({*literal});
        return [dialler] { dialler->give_up(); };
    }
    lookup->start(bounds.connect, [dialler, connect](error_code code, const std::vector<asio::ip::address>& found) {
        if (code) {
            dialler->fail(code);
        } else {
            connect(found);
        }
    });
    return [lookup, dialler] {
        lookup->give_up();
        dialler->give_up();
    };
}

std::unique_ptr<link_transport> make_tcp() { return std::make_unique<tcp_transport>(); }

} // namespace cles::transport
