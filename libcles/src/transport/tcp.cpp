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

// Detects after `limits::stall` that a peer's host is gone or unreachable, whether data is in transit to it or not.
void notice_loss(stream_socket& socket, const limits& bounds) {
    constexpr int least = 6; // seconds
    constexpr int most = 3600;
    const auto wanted = std::chrono::duration_cast<std::chrono::seconds>(bounds.stall).count();
    const int seconds = static_cast<int>(std::clamp<decltype(wanted)>(wanted, least, most));
    const auto set = [&](int option, int value) {
        ::setsockopt(socket.native_handle(), IPPROTO_TCP, option, &value, sizeof value);
    };
    set(TCP_USER_TIMEOUT, seconds * 1000);
    set(TCP_KEEPIDLE, seconds / 2);
    set(TCP_KEEPINTVL, seconds / 6);
    set(TCP_KEEPCNT, 3);
    error_code ignored;
    socket.set_option(asio::socket_base::keep_alive{true}, ignored);
}

tcp::endpoint ip_endpoint(const stream_address& any) {
    tcp::endpoint end;
    std::memcpy(end.data(), any.data(), any.size());
    end.resize(any.size());
    return end;
}

// Sets the options of a connected socket, too.
identity identify(stream_socket& socket, const url& where, const limits& bounds) {
    error_code ignored;
    set_traffic_class(socket.native_handle(), where, ignored);
    socket.set_option(tcp::no_delay{true}, ignored);
    notice_loss(socket, bounds);
    error_code gone;
    const auto peer = socket.remote_endpoint(gone);
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
    socket.bind(endpoint);
    socket.listen();
    auto local = url_of(where.scheme, ip_endpoint(socket.local_endpoint()));
    return handle_of(std::make_shared<stream_acceptor>(
        std::move(socket), std::move(local), bounds,
        [where, bounds](stream_socket& accepted) { return identify(accepted, where, bounds); }, std::move(make_codec)));
}

std::function<void()> dial_tcp(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done, codec_maker make_codec) {
    const auto dialler = std::make_shared<stream_dialler>(
        executor, bounds, [where, bounds](stream_socket& made) { return identify(made, where, bounds); },
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
