// SPDX-License-Identifier: BSL-1.0
#include "transport/udp.hpp"

#include "transport/ip_host.hpp"
#include "transport/transports.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/ip/v6_only.hpp>
#include <boost/asio/post.hpp>
#include <boost/container_hash/hash.hpp>

#include <utility>

namespace cles::transport {
namespace asio = boost::asio;
using asio::ip::udp;
using boost::system::error_code;

namespace {

bool is_empty(std::string_view datagram) { return datagram.empty() || datagram == "\n" || datagram == "\r\n"; }

} // namespace

std::size_t udp_port::endpoint_hash::operator()(const udp::endpoint& e) const noexcept {
    std::size_t seed = e.port();
    if (e.address().is_v4()) {
        boost::hash_combine(seed, e.address().to_v4().to_uint());
    } else {
        const auto bytes = e.address().to_v6().to_bytes();
        boost::hash_combine(seed, std::string_view{reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    }
    return seed;
}

udp_port::udp_port(udp::socket socket) : socket_(std::move(socket)) { receive_batch::prepare(socket_); }

url udp_port::local() const {
    error_code ignored;
    return url_of("udp", socket_.local_endpoint(ignored));
}

void udp_port::start(std::function<void(link_ptr)> on_link) {
    on_link_ = std::move(on_link);
    receive();
}

link_ptr udp_port::connect_link(const udp::endpoint& peer, identity who) {
    connected_ = true;
    auto made = std::make_shared<udp_link>(shared_from_this(), peer, std::move(who));
    links_.emplace(peer, made.get());
    return made;
}

void udp_port::close() {
    on_link_ = nullptr;
    close_if_done();
}

void udp_port::close_if_done() {
    if (links_.empty() && !on_link_) {
        error_code ignored;
        socket_.close(ignored);
    }
}

void udp_port::forget(const udp_link& link) {
    const auto found = links_.find(link.endpoint());
    if (found != links_.end() && found->second == &link) {
        if (recent_ == &link) {
            recent_ = nullptr;
        }
        links_.erase(found);
        close_if_done();
    }
}

// -- receiving -----------------------------------------------------------------------------------------------------

void udp_port::receive() {
    if (receiving_ || !socket_.is_open()) {
        return;
    }
    receiving_ = true;
    socket_.async_wait(udp::socket::wait_read, [self = shared_from_this()](error_code code) {
        if (code) {
            self->receiving_ = false;
        } else {
            self->hand_over();
        }
    });
}

// Counts as receiving until everything is delivered: a link that starts meanwhile must not start to wait.
void udp_port::hand_over() {
    const auto go_on_soon = [this] {
        asio::post(socket_.get_executor(), [self = shared_from_this()] { self->hand_over(); });
    };
    bool left = false;
    try {
        left = arrived_.hand_over(socket_, [this](const receive_batch::datagram& one) { hand_over(one); });
    } catch (...) { // of a handler, for the thread that runs the context; other datagrams are not affected
        go_on_soon();
        throw;
    }
    if (left) {
        go_on_soon();
        return;
    }
    receiving_ = false;
    receive();
}

void udp_port::hand_over(const receive_batch::datagram& one) {
    if (is_empty(one.text)) {
        return;
    }
    if (const auto link = link_of(one.from)) {
        link->deliver(one.text);
    }
}

std::shared_ptr<udp_link> udp_port::link_of(const udp::endpoint& sender) {
    if (recent_ != nullptr && recent_->endpoint() == sender) {
        return recent_->shared_from_this();
    }
    if (const auto found = links_.find(sender); found != links_.end()) {
        recent_ = found->second;
        return recent_->shared_from_this();
    }
    if (!on_link_) {
        return nullptr;
    }
    auto made = std::make_shared<udp_link>(shared_from_this(), sender, identity_at("udp", sender));
    links_.emplace(sender, made.get());
    recent_ = made.get();
    const auto tell = on_link_; // copied: it may be cleared meanwhile
    tell(made);
    return made;
}

// -- sending -------------------------------------------------------------------------------------------------------

core::datagrams_done udp_port::send(const udp_link& to, std::string_view lines) {
    return burst_.send_all(lines, connected_ ? nullptr : &to.endpoint());
}

void udp_port::wait_until_writable(std::weak_ptr<udp_link> link) {
    socket_.async_wait(udp::socket::wait_write, [self = shared_from_this(), link = std::move(link)](error_code) {
        if (const auto alive = link.lock()) {
            alive->on_writable();
        }
    });
}

udp_link::udp_link(std::shared_ptr<udp_port> socket, asio::ip::udp::endpoint peer, identity who)
    : port_(std::move(socket)), peer_(std::move(peer)), who_(std::move(who)) {}

udp_link::~udp_link() { udp_link::close(); }

void udp_link::start(std::shared_ptr<link_events> owner) {
    owner_ = std::move(owner);
    if (port_ == nullptr) {
        return;
    }
    port_->receive();
    if (!early_.empty()) {
        asio::post(port_->executor(), [self = shared_from_this()] {
            for (const auto& datagram : std::exchange(self->early_, {})) {
                self->deliver(datagram);
            }
        });
    }
}

void udp_link::deliver(std::string_view datagram) {
    if (port_ == nullptr) {
        return;
    }
    if (owner_ == nullptr) {
        constexpr std::size_t max_early = 16;
        if (early_.size() < max_early) {
            early_.emplace_back(datagram);
        }
        return;
    }
    received_ += datagram.size();
    if (paused_) {
        return;
    }
    const auto owner = owner_; // it may close the link
    if (datagram.size() > protocol::datagram_bytes) {
        owner->on_overlong(datagram.substr(0, protocol::datagram_bytes));
    } else {
        if (datagram.ends_with('\n')) {
            datagram.remove_suffix(1);
        }
        owner->on_line(datagram);
    }
    if (port_ != nullptr) {
        owner->on_batch();
    }
}

void udp_link::flush() {
    if (port_ == nullptr || output_.empty()) {
        return;
    }
    take_output();
    send_rest();
}

// Takes all of it at once: the flushing code relies on finding only new output the next time.
void udp_link::take_output() {
    if (sending_.empty()) {
        sending_.swap(output_);
        sending_at_ = 0;
        return;
    }
    if (sending_at_ > sending_.size() / 2) {
        sending_.erase(0, sending_at_);
        sending_at_ = 0;
    }
    sending_.append(output_);
    output_.clear();
}

void udp_link::send_rest() {
    if (waiting_) {
        return;
    }
    const auto count = port_->send(*this, std::string_view{sending_}.substr(sending_at_)).bytes;
    sent_ += count;
    sending_at_ += count;
    if (sending_at_ < sending_.size()) {
        waiting_ = true;
        port_->wait_until_writable(weak_from_this());
        return;
    }
    constexpr std::size_t max_kept = 65536;
    if (sending_.capacity() > max_kept) {
        std::string{}.swap(sending_); // assigning an empty string would keep the memory
    }
    sending_.clear();
    sending_at_ = 0;
}

void udp_link::on_writable() {
    waiting_ = false;
    if (port_ == nullptr) {
        return;
    }
    send_rest();
    if (const auto owner = owner_; owner && sending_.empty()) {
        owner->on_writable();
    }
}

// There is no peer to notify.
void udp_link::finish() {
    if (port_ == nullptr) {
        return;
    }
    flush();
    asio::post(port_->executor(), [self = shared_from_this()] {
        const auto owner = self->owner_;
        if (self->port_ != nullptr) {
            self->close();
            if (owner) {
                owner->on_lost(asio::error::eof);
            }
        }
    });
}

void udp_link::shrink() {
    if (output_.empty() && sending_.empty()) {
        std::string{}.swap(output_);
        std::string{}.swap(sending_);
    }
}

void udp_link::close() {
    if (const auto port = std::exchange(port_, nullptr)) {
        owner_.reset();
        port->forget(*this);
    }
}

// -- the transport -------------------------------------------------------------------------------------------------

namespace {

class udp_transport final : public link_transport {
  public:
    [[nodiscard]] bool is_exposed(const url& where) const override { return is_beyond_loopback(where); }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where, const limits&) override {
        const udp::endpoint endpoint{resolve(where), where.port};
        udp::socket socket{executor};
        socket.open(endpoint.protocol());
        if (endpoint.address().is_v6()) {
            socket.set_option(asio::ip::v6_only{true});
        }
        socket.bind(endpoint);
        error_code code;
        set_traffic_class(socket.native_handle(), where, code);
        if (code) {
            throw boost::system::system_error{code};
        }
        return handle_of(std::make_shared<udp_port>(std::move(socket)));
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
            set_traffic_class(socket.native_handle(), where, code);
        }
        if (!code) {
            socket.connect(endpoint, code);
        }
        if (code) {
            return nullptr;
        }
        return std::make_shared<udp_port>(std::move(socket))->connect_link(endpoint, identity_at("udp", endpoint));
    }
};

} // namespace

std::unique_ptr<link_transport> make_udp() { return std::make_unique<udp_transport>(); }

} // namespace cles::transport
