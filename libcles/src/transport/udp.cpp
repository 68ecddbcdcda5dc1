// SPDX-License-Identifier: BSL-1.0
#include "transport/ip_host.hpp"
#include "transport/transports.hpp"
#include "transport/udp_port.hpp"

#include <boost/asio/ip/udp.hpp>
#include <boost/asio/ip/v6_only.hpp>

#include <memory>
#include <utility>
#include <vector>

namespace cles::transport {
namespace asio = boost::asio;
using asio::ip::udp;
using boost::system::error_code;

namespace {

class udp_acceptor final : public acceptor {
  public:
    explicit udp_acceptor(std::shared_ptr<udp_port> inside) : inside_(std::move(inside)) {}
    ~udp_acceptor() override { inside_->close(); }

    [[nodiscard]] url local() const override { return url_of("udp", inside_->local()); }
    void start(std::function<void(link_ptr)> on_link) override { inside_->accept(std::move(on_link)); }
    void close() override { inside_->close(); }

  private:
    std::shared_ptr<udp_port> inside_;
};

class udp_transport final : public link_transport {
  public:
    [[nodiscard]] bool is_exposed(const url& where) const override {
        error_code code;
        const auto address = resolve(where, code);
        return !code && !address.is_loopback(); // without an address, listening fails anyway
    }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where, const limits&) override {
        error_code code;
        const udp::endpoint endpoint{resolve(where, code), where.port};
        if (code) {
            throw boost::system::system_error{code};
        }
        udp::socket socket{executor};
        socket.open(endpoint.protocol());
        if (endpoint.address().is_v6()) {
            socket.set_option(asio::ip::v6_only{true});
        }
        socket.bind(endpoint);
        set_traffic_class(socket, where, code);
        if (code) {
            throw boost::system::system_error{code};
        }
        return std::make_unique<udp_acceptor>(std::make_shared<udp_port>(std::move(socket)));
    }

    // Sends nothing: whether the peer exists shows when requests are answered.
    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        const auto lookup = std::make_shared<host_lookup>(executor);
        lookup->start(
            where, bounds.connect,
            [executor, where, done = std::move(done)](error_code code, const std::vector<asio::ip::address>& found) {
                link_ptr made;
                if (!code) {
                    made = connect(executor, where, {found.front(), where.port}, code);
                }
                done(code, made);
            });
        return [lookup] { lookup->give_up(); };
    }

  private:
    static link_ptr connect(const asio::any_io_executor& executor, const url& where, const udp::endpoint& endpoint,
                            error_code& code) {
        udp::socket socket{executor};
        socket.open(endpoint.protocol(), code);
        if (!code) {
            set_traffic_class(socket, where, code);
        }
        if (!code) {
            socket.connect(endpoint, code);
        }
        if (code) {
            return nullptr;
        }
        return std::make_shared<udp_port>(std::move(socket))
            ->connect_link(endpoint, {.transport = "udp",
                                      .address = to_string(url_of("udp", endpoint)),
                                      .name = {},
                                      .uid = {},
                                      .local = endpoint.address().is_loopback()});
    }
};

} // namespace

std::unique_ptr<link_transport> make_udp() { return std::make_unique<udp_transport>(); }

} // namespace cles::transport
