// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "transport/ip_host.hpp"
#include "transport/stream_endpoint.hpp"
#include "transport/transports.hpp"

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/v6_only.hpp>

#include <algorithm>
#include <chrono>
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
void notice_loss(tcp::socket& socket, const limits& bounds) {
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

void tune(tcp::socket& socket, const url& where, const limits& bounds) {
    error_code ignored;
    set_traffic_class(socket, where, ignored);
    socket.set_option(tcp::no_delay{true}, ignored);
    notice_loss(socket, bounds);
}

identity identify(tcp::socket& socket, const url& where, const limits& bounds) {
    tune(socket, where, bounds);
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
        : inside_(
              std::make_shared<stream_acceptor<tcp>>(std::move(socket), bounds, [where, bounds](tcp::socket& accepted) {
                  return identify(accepted, where, bounds);
              })) {}
    ~tcp_acceptor() override { inside_->close(); }

    [[nodiscard]] url local() const override {
        error_code ignored;
        return url_of("tcp", inside_->socket().local_endpoint(ignored));
    }
    void start(std::function<void(link_ptr)> on_link) override { inside_->start(std::move(on_link)); }
    void accept_waiting() override { inside_->accept_waiting(); }
    void close() override { inside_->close(); }

  private:
    std::shared_ptr<stream_acceptor<tcp>> inside_;
};

/// Makes one connection to a host: looks up its name, if it has one, and tries its addresses.
class tcp_call : public std::enable_shared_from_this<tcp_call> {
  public:
    tcp_call(const asio::any_io_executor& executor, url where, const limits& bounds, dial_callback done)
        : executor_(executor), where_(std::move(where)), bounds_(bounds), done_(std::move(done)) {}

    void start() {
        if (const auto literal = literal_address(where_)) {
            connect({*literal}, bounds_.connect);
            return;
        }
        lookup_ = std::make_shared<host_lookup>(executor_);
        lookup_->start(where_, bounds_.connect,
                       [self = shared_from_this(), begun = std::chrono::steady_clock::now()](
                           error_code code, const std::vector<asio::ip::address>& found) {
                           if (code) {
                               const auto done = std::move(self->done_);
                               done(code, nullptr);
                               return;
                           }
                           const auto spent = std::chrono::steady_clock::now() - begun;
                           self->connect(found,
                                         std::chrono::ceil<std::chrono::milliseconds>(self->bounds_.connect - spent));
                       });
    }

    void give_up() {
        if (lookup_) {
            lookup_->give_up();
        }
        if (dialler_) {
            dialler_->give_up();
        }
    }

  private:
    void connect(const std::vector<asio::ip::address>& addresses, std::chrono::milliseconds left) {
        std::vector<tcp::endpoint> endpoints;
        endpoints.reserve(addresses.size());
        for (const auto& address : addresses) {
            endpoints.emplace_back(address, where_.port);
        }
        dialler_ = std::make_shared<stream_dialler<tcp>>(
            executor_, bounds_,
            [where = where_, bounds = bounds_](tcp::socket& made) { return identify(made, where, bounds); },
            std::move(done_));
        dialler_->start(std::move(endpoints), left);
    }

    asio::any_io_executor executor_;
    url where_;
    limits bounds_;
    dial_callback done_;
    std::shared_ptr<host_lookup> lookup_;
    std::shared_ptr<stream_dialler<tcp>> dialler_;
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
        const auto call = std::make_shared<tcp_call>(executor, where, bounds, std::move(done));
        call->start();
        return [call] { call->give_up(); };
    }
};

} // namespace

std::unique_ptr<link_transport> make_tcp() { return std::make_unique<tcp_transport>(); }

} // namespace cles::transport
