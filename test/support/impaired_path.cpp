// SPDX-License-Identifier: BSL-1.0
#include "support/impaired_path.hpp"

#include <cles/url.hpp>

#include <boost/asio/buffer.hpp>
#include <boost/asio/steady_timer.hpp>

#include <array>
#include <utility>

namespace cles::test {
namespace asio = boost::asio;
using asio::ip::udp;
using boost::system::error_code;

class impaired_path::inside : public std::enable_shared_from_this<inside> {
  public:
    inside(asio::io_context& io, const cles::url& node, impairment wanted, std::uint32_t seed)
        : io_(io), node_(asio::ip::make_address(node.host), node.port), how(wanted), chance_(seed),
          door_(io, udp::endpoint{asio::ip::address_v4::loopback(), 0}) {}

    void listen() {
        door_.async_receive_from(asio::buffer(buffer_), sender_,
                                 [self = shared_from_this()](error_code code, std::size_t count) {
                                     if (code == asio::error::operation_aborted) {
                                         return;
                                     }
                                     if (!code) {
                                         self->on_client({self->buffer_.data(), count});
                                     }
                                     self->listen();
                                 });
    }
    void close() {
        closed_ = true;
        error_code ignored;
        door_.close(ignored);
        for (auto& [from, c] : clients_) {
            c->socket.close(ignored);
        }
        clients_.clear();
    }
    [[nodiscard]] std::uint16_t port() const { return door_.local_endpoint().port(); }

  private:
    struct client {
        client(asio::io_context& io, const udp::endpoint& node) : socket(io, udp::v4()) { socket.connect(node); }
        udp::socket socket;
        std::array<char, 65536> buffer{};
    };

    void on_client(std::string_view datagram) {
        ++to_node;
        auto& c = clients_[sender_];
        if (!c) {
            c = std::make_shared<client>(io_, node_);
            answer(c, sender_);
        }
        carry(datagram, true, [to = c](const std::string& bytes) {
            error_code ignored;
            to->socket.send(asio::buffer(bytes), 0, ignored);
        });
    }

    void answer(const std::shared_ptr<client>& c, const udp::endpoint& to) {
        c->socket.async_receive(asio::buffer(c->buffer),
                                [self = shared_from_this(), c, to](error_code code, std::size_t count) {
                                    if (code == asio::error::operation_aborted || self->closed_) {
                                        return;
                                    }
                                    if (!code) {
                                        self->on_node({c->buffer.data(), count}, to);
                                    }
                                    self->answer(c, to);
                                });
    }

    void on_node(std::string_view datagram, const udp::endpoint& to) {
        ++to_clients;
        carry(datagram, false, [self = shared_from_this(), to](const std::string& bytes) {
            error_code ignored;
            self->door_.send_to(asio::buffer(bytes), to, 0, ignored);
        });
    }

    void carry(std::string_view datagram, bool is_to_node, const std::function<void(const std::string&)>& deliver) {
        if ((drop && drop(datagram, is_to_node)) || happens(how.loss)) {
            ++lost;
            return;
        }
        const bool again = happens(how.twice);
        doubled += again ? 1 : 0;
        for (int i = 0; i < (again ? 2 : 1); ++i) {
            later(std::string{datagram}, deliver);
        }
    }

    void later(std::string bytes, const std::function<void(const std::string&)>& deliver) {
        std::uniform_int_distribution<std::int64_t> delays{how.least_delay.count(), how.most_delay.count()};
        const std::chrono::milliseconds delay{delays(chance_)};
        if (delay.count() == 0) {
            deliver(bytes);
            return;
        }
        auto timer = std::make_shared<asio::steady_timer>(io_, delay);
        timer->async_wait([self = shared_from_this(), timer, bytes = std::move(bytes), deliver](error_code code) {
            if (!code && !self->closed_) {
                deliver(bytes);
            }
        });
    }

    bool happens(double share) { return std::uniform_real_distribution<>{0, 1}(chance_) < share; }

    asio::io_context& io_;
    udp::endpoint node_;

  public:
    impairment how;
    std::function<bool(std::string_view, bool)> drop{};
    std::uint64_t to_node = 0;
    std::uint64_t to_clients = 0;
    std::uint64_t lost = 0;
    std::uint64_t doubled = 0;

  private:
    std::mt19937 chance_;
    udp::socket door_;
    udp::endpoint sender_;
    std::array<char, 65536> buffer_{};
    std::map<udp::endpoint, std::shared_ptr<client>> clients_;
    bool closed_ = false;
};

impaired_path::impaired_path(asio::io_context& io, std::string_view node, impairment how, std::uint32_t seed)
    : inside_(std::make_shared<inside>(io, parse_url(node), how, seed)) {
    inside_->listen();
}

impaired_path::~impaired_path() { inside_->close(); }

std::string impaired_path::url() const { return "udp://127.0.0.1:" + std::to_string(inside_->port()); }
void impaired_path::set(impairment how) { inside_->how = how; }
void impaired_path::filter(std::function<bool(std::string_view, bool)> drop) { inside_->drop = std::move(drop); }
std::uint64_t impaired_path::to_node() const { return inside_->to_node; }
std::uint64_t impaired_path::to_clients() const { return inside_->to_clients; }
std::uint64_t impaired_path::lost() const { return inside_->lost; }
std::uint64_t impaired_path::doubled() const { return inside_->doubled; }

} // namespace cles::test
