// SPDX-License-Identifier: BSL-1.0
#include "transport/udp.hpp"

#include "transport/host_lookup.hpp"
#include "transport/ip_host.hpp"
#include "transport/member_handler.hpp"
#include "transport/private_socket.hpp"
#include "transport/transports.hpp"
#include "transport/udp_dialler.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/ip/address_v4.hpp>
#include <boost/asio/ip/v6_only.hpp>
#include <boost/asio/socket_base.hpp>

#include <array>
#include <cerrno>
#include <utility>

#include <netinet/in.h>
#include <sys/socket.h>

namespace cles::transport {
namespace asio = boost::asio;
using asio::ip::udp;
using boost::system::error_code;

namespace {

bool is_empty(std::string_view datagram) { return datagram.empty() || datagram == "\n" || datagram == "\r\n"; }

} // namespace

udp_port::udp_port(udp::socket socket, std::unique_ptr<datagram_codec> codec)
    : socket_(std::move(socket)), codec_(std::move(codec)) {
    receive_batch::prepare(socket_);
    if (codec_) {
        codec_->start(*this);
    }
}

url udp_port::local() const {
    error_code ignored;
    return url_of("udp", socket_.local_endpoint(ignored));
}

void udp_port::start(std::function<void(link_ptr)> on_link) {
    on_link_ = std::move(on_link);
    receive();
}

std::shared_ptr<udp_link> udp_port::connect_link(const udp::endpoint& peer, identity who, std::uint32_t member) {
    connected_ = true;
    auto made = std::make_shared<udp_link>(shared_from_this(), datagram_origin{peer, member}, std::move(who));
    links_.emplace(made->origin(), made.get());
    return made;
}

void udp_port::close() {
    on_link_ = nullptr;
    close_if_done();
}

void udp_port::close_if_done() {
    if (links_.empty() && !on_link_) {
        if (codec_) {
            codec_->stop();
        }
        error_code ignored;
        socket_.close(ignored);
    }
}

void udp_port::forget(const udp_link& link) {
    const auto found = links_.find(link.origin());
    if (found != links_.end() && found->second == &link) {
        if (recent_ == &link) {
            recent_ = nullptr;
        }
        links_.erase(found);
        if (codec_) {
            codec_->release(link.origin());
        }
        close_if_done();
    }
}

// -- receiving -----------------------------------------------------------------------------------------------------

void udp_port::receive() {
    if (receiving_ || !socket_.is_open()) {
        return;
    }
    receiving_ = true;
    wait_call<&udp_port::on_readable>(socket_, udp::socket::wait_read, shared_from_this());
}

void udp_port::on_readable(error_code code) {
    if (code) {
        receiving_ = false;
    } else {
        hand_over();
    }
}

// Counts as receiving until everything is delivered: a link that starts meanwhile must not start to wait.
void udp_port::hand_over() {
    const bool all = arrived_.hand_over_in_turns(
        socket_, [this](const receive_batch::datagram& one) { take(one); },
        [this] { post_call<&udp_port::hand_over>(socket_.get_executor(), shared_from_this()); });
    if (all) {
        receiving_ = false;
        receive();
    }
}

void udp_port::take(const receive_batch::datagram& one) {
    if (codec_) {
        codec_->receive(one.from, one.text);
        return;
    }
    if (is_empty(one.text)) {
        return;
    }
    if (auto* const link = find(one.from, 0)) {
        link->shared_from_this()->deliver(one.text);
    } else if (const auto made = accept(one.from, 0, 0)) {
        made->deliver(one.text);
    }
}

udp_link* udp_port::find(const udp::endpoint& sender, std::uint32_t member) {
    if (recent_ != nullptr && recent_->origin().at == sender && recent_->origin().member == member) {
        return recent_;
    }
    const auto found = links_.find(datagram_origin{sender, member});
    if (found == links_.end()) {
        return nullptr;
    }
    return recent_ = found->second;
}

std::shared_ptr<udp_link> udp_port::accept(const udp::endpoint& sender, std::uint32_t member, std::uint32_t epoch) {
    if (!on_link_) {
        return nullptr;
    }
    auto who = identity_at("udp", sender);
    if (codec_) {
        who.name = codec_->name_of(member);
    }
    auto made = std::make_shared<udp_link>(shared_from_this(), datagram_origin{sender, member}, std::move(who));
    if (codec_) {
        made->note_epoch(epoch);
    }
    links_.emplace(made->origin(), made.get());
    recent_ = made.get();
    const auto tell = on_link_; // copied: it may be cleared meanwhile
    tell(made);
    return made;
}

// -- with a codec --------------------------------------------------------------------------------------------------

void udp_port::on_opened(const datagram_origin& from, std::uint32_t epoch, std::string_view line) {
    const auto keep = shared_from_this();
    if (auto* const link = find(from.at, from.member)) {
        const auto held = link->shared_from_this();
        held->note_epoch(epoch);
        held->deliver(line);
    } else if (const auto made = accept(from.at, from.member, epoch)) {
        made->deliver(line);
    }
}

// What this socket has accepted ends: the next line makes a link to the new process. A link that was dialled goes on,
// since its requests are for the member, in whatever process.
void udp_port::on_established(const datagram_origin& with, std::uint32_t epoch) {
    const auto keep = shared_from_this();
    if (auto* const link = find(with.at, with.member)) {
        const auto held = link->shared_from_this();
        if (held->note_epoch(epoch)) {
            if (connected_) {
                held->on_restart();
            } else {
                held->lose(asio::error::connection_reset);
            }
        }
        held->on_session();
    }
}

void udp_port::on_unanswered(const datagram_origin& with, bool lost) {
    const auto keep = shared_from_this();
    if (auto* const link = find(with.at, with.member)) {
        link->shared_from_this()->on_unanswered(lost);
    }
}

// Later: the line that brought the roster may have come by one of these links.
void udp_port::on_removed(std::uint32_t member) {
    for (const auto& [origin, link] : links_) {
        if (origin.member == member) {
            post_call<&udp_link::lose>(socket_.get_executor(), link->shared_from_this(), asio::error::no_permission);
        }
    }
}

void udp_port::transmit(const udp::endpoint& to, std::string_view datagram) {
    const auto size = static_cast<std::uint16_t>(datagram.size());
    if (sealing_) {
        sealed_.append(datagram);
        sizes_.push_back(size);
    } else {
        burst_.send_all({datagram, {&size, 1}}, address_of(to));
    }
}

void udp_port::check_peer(const udp_link& link, time_point since) {
    if (codec_) {
        codec_->check_peer(link.origin(), since);
    }
}

bool udp_port::contact(const udp_link& link) {
    if (codec_) {
        codec_->contact(link.origin());
    }
    return codec_ != nullptr;
}

// If the socket has no space for all of them, the rest is sealed again later: that is simpler than to keep both forms.
core::datagrams_done udp_port::send_sealed(const udp_link& to, std::string_view lines) {
    constexpr std::size_t at_once = 32;
    struct position {
        std::size_t bytes;     // of the lines
        std::size_t datagrams; // that they became: none for one that waits for a session
    };
    std::array<position, at_once> after; // NOLINT(cppcoreguidelines-pro-type-member-init): only entries in use are set
    core::datagrams_done done;
    for (core::datagram_list rest{lines}; !rest.empty();) {
        std::size_t count = 0;
        sealed_.clear();
        sizes_.clear();
        sealing_ = true;
        for (std::size_t bytes = 0; count < at_once && !rest.empty(); ++count) {
            auto line = rest.first();
            rest.drop_first();
            bytes += line.size();
            line.remove_suffix(1);
            codec_->send(to.origin(), line);
            after[count] = {.bytes = bytes, .datagrams = sizes_.size()};
        }
        sealing_ = false;
        const auto sent = burst_.send_all({sealed_, sizes_}, address_of(to.origin().at)).count;
        std::size_t passed = 0;
        while (passed < count && after[passed].datagrams <= sent) {
            ++passed;
        }
        if (passed != 0) {
            done.count += passed;
            done.bytes += after[passed - 1].bytes;
        }
        if (passed < count) {
            break;
        }
    }
    return done;
}

// -- sending -------------------------------------------------------------------------------------------------------

core::datagrams_done udp_port::send(const udp_link& to, std::string_view lines) {
    return codec_ ? send_sealed(to, lines) : burst_.send_all(lines, address_of(to.origin().at));
}

void udp_port::wait_until_writable(std::weak_ptr<udp_link> link) {
    waiting_.push_back(std::move(link));
    wait_call<&udp_port::on_writable>(socket_, udp::socket::wait_write, shared_from_this());
}

// For the first link that waits. Each waits on its own, so that another goes on if the owner of one throws.
void udp_port::on_writable() {
    const auto link = waiting_.front().lock();
    waiting_.erase(waiting_.begin());
    if (link) {
        link->on_writable();
    }
}

udp_link::udp_link(std::shared_ptr<udp_port> socket, datagram_origin peer, identity who)
    : port_(std::move(socket)), peer_(std::move(peer)), who_(std::move(who)) {}

udp_link::~udp_link() { udp_link::close(); }

void udp_link::start(std::shared_ptr<link_events> owner) {
    owner_ = std::move(owner);
    if (port_ == nullptr) {
        return;
    }
    port_->receive();
    if (!early_.empty()) {
        post_call<&udp_link::deliver_early>(port_->executor(), shared_from_this());
    }
}

void udp_link::deliver_early() {
    for (const auto& datagram : std::exchange(early_, {})) {
        deliver(datagram);
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
    post_call<&udp_link::lose>(port_->executor(), shared_from_this(), asio::error::eof);
}

void udp_link::shrink() {
    if (output_.empty() && sending_.empty()) {
        std::string{}.swap(output_);
        std::string{}.swap(sending_);
    }
}

void udp_link::lose(error_code why) {
    const auto owner = owner_;
    if (port_ != nullptr) {
        close();
        if (owner) {
            owner->on_lost(why);
        }
    }
}

bool udp_link::note_epoch(std::uint32_t epoch) {
    if (epoch_number_ == epoch) {
        return false;
    }
    epoch_ = protocol::epoch_text(epoch);
    return std::exchange(epoch_number_, epoch).has_value();
}

void udp_link::on_restart() {
    if (const auto owner = owner_) {
        owner->on_restart();
    }
}

void udp_link::on_unanswered(bool lost) {
    if (const auto owner = owner_) {
        owner->on_unanswered(lost);
    }
}

void udp_link::check_peer(time_point since) {
    if (port_ != nullptr) {
        port_->check_peer(*this, since);
    }
}

void udp_link::ask() {
    if (port_ != nullptr && !port_->contact(*this)) {
        output_.append("PULL self:cles id=").append(std::to_string(udp_dialler::question_id)).push_back('\n');
        flush();
    }
}

void udp_link::on_session() {
    if (const auto begun = std::exchange(on_session_, nullptr)) {
        begun();
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

std::shared_ptr<udp_link> connect(const asio::any_io_executor& executor, const url& where,
                                  const udp::endpoint& endpoint, const sealed_peer_maker& peer, error_code& code) {
    sealed_peer who;
    if (peer) {
        who = peer(code);
    }
    udp::socket socket{executor};
    if (!code) {
        open_private(socket, endpoint.protocol(), code);
    }
    if (!code) {
        set_traffic_class(socket.native_handle(), where, code);
    }
    if (!code) {
        socket.connect(endpoint, code);
    }
    if (code) {
        return nullptr;
    }
    auto described = identity_at("udp", endpoint);
    described.name = std::move(who.name);
    return std::make_shared<udp_port>(std::move(socket), std::move(who.codec))
        ->connect_link(endpoint, std::move(described), who.member);
}

class udp_transport final : public link_transport {
  public:
    [[nodiscard]] bool is_exposed(const url& where) const override { return is_beyond_loopback(where); }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where, const limits&) override {
        return listen_udp(executor, where);
    }

    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        return dial_udp(executor, where, bounds, std::move(done));
    }
};

void set_ipv4_option(udp::socket& socket, int option, int value) {
    if (::setsockopt(socket.native_handle(), IPPROTO_IP, option, &value, sizeof value) != 0) {
        throw boost::system::system_error{errno, boost::system::system_category()};
    }
}

/// Binds a socket to all IPv4 addresses of this host, and leaves multicast groups of the same port to others.
///
/// The address 0.0.0.0 includes those of groups, so the system gives a port to both only if both sockets allow reuse.
/// But two that allow it could then also listen at the same address, where the later one takes what is for the earlier
/// one. So another socket claims the port first, without reuse, at an address that no group has.
void bind_beside_groups(udp::socket& socket, const udp::endpoint& at) {
    const asio::socket_base::reuse_address reuse{true};
    set_ipv4_option(socket, IP_MULTICAST_ALL, 0); // otherwise it receives the groups that others have joined
    if (at.port() == 0) {
        socket.bind(at); // to a port that is free in all respects
        socket.set_option(reuse);
        return;
    }
    auto claim = make_private<udp::socket>(socket.get_executor(), at.protocol());
    set_ipv4_option(claim, IP_FREEBIND, 1); // loopback may be down
    claim.bind({asio::ip::address_v4::loopback(), at.port()});
    claim.set_option(reuse);
    socket.set_option(reuse);
    socket.bind(at);
}

} // namespace

std::unique_ptr<acceptor> listen_udp(const asio::any_io_executor& executor, const url& where,
                                     std::unique_ptr<datagram_codec> codec) {
    const udp::endpoint endpoint{resolve(where), where.port};
    auto socket = make_private<udp::socket>(executor, endpoint.protocol());
    if (endpoint.address().is_v6()) {
        socket.set_option(asio::ip::v6_only{true});
    }
    if (endpoint.address().is_v4() && endpoint.address().is_unspecified()) {
        bind_beside_groups(socket, endpoint);
    } else {
        socket.bind(endpoint);
    }
    error_code code;
    set_traffic_class(socket.native_handle(), where, code);
    if (code) {
        throw boost::system::system_error{code};
    }
    return handle_of(std::make_shared<udp_port>(std::move(socket), std::move(codec)));
}

// To the only address of a host, this sends nothing: whether the peer exists shows when requests are answered.
std::function<void()> dial_udp(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done, sealed_peer_maker peer) {
    const auto lookup = std::make_shared<host_lookup>(executor, where);
    const auto make = [executor, where, peer = std::move(peer)](const udp::endpoint& to, error_code& code) {
        return connect(executor, where, to, peer, code);
    };
    // Holds `done`. Its time begins here.
    const auto dialler = std::make_shared<udp_dialler>(executor, bounds, make, std::move(done));
    lookup->start(bounds.connect, [dialler, port = where.port, weak = std::weak_ptr{lookup}](
                                      error_code code, const std::vector<asio::ip::address>& found) {
        if (code) {
            dialler->fail(code);
            return;
        }
        std::vector<udp::endpoint> endpoints;
        endpoints.reserve(found.size());
        for (const auto& address : found) {
            endpoints.emplace_back(address, port);
        }
        dialler->start(std::move(endpoints), [found, weak](std::size_t which) {
            if (const auto by = weak.lock()) {
                by->prefer(found[which]);
            }
        });
    });
    return [lookup, dialler] {
        lookup->give_up();
        dialler->give_up();
    };
}

std::unique_ptr<link_transport> make_udp() { return std::make_unique<udp_transport>(); }

} // namespace cles::transport
