// SPDX-License-Identifier: BSL-1.0
#include "transport/tcp.hpp"

#include <cles/error.hpp>

#include "transport/ip_host.hpp"
#include "transport/stream_acceptor.hpp"
#include "transport/stream_dialler.hpp"
#include "transport/traffic_class.hpp"

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/v6_only.hpp>
#include <boost/asio/post.hpp>

#include <utility>
#include <vector>

namespace cles::transport {
namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

namespace {

std::vector<tcp::endpoint> endpoints_of(const url& where, error_code& code) {
    std::vector<tcp::endpoint> endpoints;
    for (const auto& address : resolve_all(where, code)) {
        endpoints.emplace_back(address, where.port);
    }
    return endpoints;
}

void tune(tcp::socket& socket, const url& where) {
    error_code ignored;
    set_traffic_class(socket, where, ignored);
    socket.set_option(tcp::no_delay{true}, ignored);
    socket.set_option(asio::socket_base::keep_alive{true}, ignored);
}

identity identify(tcp::socket& socket, const url& where) {
    tune(socket, where);
    error_code gone;
    const auto peer = socket.remote_endpoint(gone);
    identity who{.transport = "tcp", .address = {}, .name = {}, .uid = {}};
    if (!gone) {
        who.address = to_string(url_of("tcp", peer));
        who.local = peer.address().is_loopback();
    }
    return who;
}

class tcp_acceptor final : public acceptor {
  public:
    tcp_acceptor(tcp::acceptor socket, const url& where, const limits& bounds)
        : inside_(std::make_shared<stream_acceptor<tcp>>(
              std::move(socket), bounds, [where](tcp::socket& accepted) { return identify(accepted, where); })) {}
    ~tcp_acceptor() override { inside_->close(); }

    [[nodiscard]] url local() const override {
        error_code ignored;
        return url_of("tcp", inside_->socket().local_endpoint(ignored));
    }
    void start(std::function<void(link_ptr)> on_link) override { inside_->start(std::move(on_link)); }
    void close() override { inside_->close(); }

  private:
    std::shared_ptr<stream_acceptor<tcp>> inside_;
};

class tcp_transport final : public link_transport {
  public:
    [[nodiscard]] bool is_exposed(const url& where) const override {
        error_code code;
        const auto address = resolve(where, code);
        return !code && !address.is_loopback(); // without an address, listening fails anyway
    }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where,
                                     const limits& bounds) override {
        error_code code;
        const tcp::endpoint endpoint{resolve(where, code), where.port};
        if (code) {
            throw boost::system::system_error{code};
        }
        tcp::acceptor socket{executor};
        socket.open(endpoint.protocol());
        socket.set_option(asio::socket_base::reuse_address{true});
        if (endpoint.address().is_v6()) {
            socket.set_option(asio::ip::v6_only{true});
        }
        socket.bind(endpoint);
        socket.listen();
        return std::make_unique<tcp_acceptor>(std::move(socket), where, bounds);
    }

    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        error_code code;
        auto endpoints = endpoints_of(where, code);
        if (code) {
            asio::post(executor, [done = std::move(done), code] { done(code, nullptr); });
            return [] {};
        }
        auto dialler = std::make_shared<stream_dialler<tcp>>(
            executor, bounds, [where](tcp::socket& socket) { return identify(socket, where); }, std::move(done));
        dialler->start(std::move(endpoints));
        return [weak = std::weak_ptr{dialler}] {
            if (const auto alive = weak.lock()) {
                alive->give_up();
            }
        };
    }
};

} // namespace

std::unique_ptr<link_transport> make_tcp() { return std::make_unique<tcp_transport>(); }

} // namespace cles::transport
