// SPDX-License-Identifier: BSL-1.0
#include "transport/group_port.hpp"

#include <cles/shared_reading.hpp>

#include "protocol/request_line.hpp"
#include "transport/member_handler.hpp"
#include "transport/private_socket.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/execution/context.hpp>
#include <boost/asio/execution_context.hpp>
#include <boost/asio/query.hpp>
#include <boost/system/system_error.hpp>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include <linux/filter.h>
#include <netinet/in.h>
#include <sys/socket.h>

namespace cles::transport {
namespace asio = boost::asio;
using asio::ip::udp;
using boost::system::error_code;

namespace {

/// Sets an option that Asio lacks, or for which it takes an address instead of an interface's index.
/// \throws boost::system::system_error
template <class T>
void set_ip_option(udp::socket& socket, int option, const T& value) {
    if (::setsockopt(socket.native_handle(), IPPROTO_IP, option, &value, sizeof value) != 0) {
        throw boost::system::system_error{errno, boost::system::system_category()};
    }
}

ip_mreqn membership(const udp::endpoint& group, int interface) noexcept {
    ip_mreqn wanted{};
    wanted.imr_multiaddr.s_addr = htonl(group.address().to_v4().to_uint());
    wanted.imr_ifindex = interface;
    return wanted;
}

template <std::size_t N>
void attach(udp::socket& socket, std::array<sock_filter, N>& program) noexcept {
    const sock_fprog filter{.len = static_cast<unsigned short>(N), .filter = program.data()};
    static_cast<void>(::setsockopt(socket.native_handle(), SOL_SOCKET, SO_ATTACH_FILTER, &filter,
                                   sizeof filter)); // else everything still arrives
}

// Makes the system drop what arrives from this address and port before it is queued (a classic BPF filter, see
// socket(7)). Replaces an earlier filter.
void drop_from(udp::socket& socket, const udp::endpoint& source) noexcept {
    constexpr auto whole = UINT32_MAX;
    // A filter on a datagram socket sees the UDP header first; the IP header has an offset of its own.
    constexpr auto source_address = static_cast<std::uint32_t>(SKF_NET_OFF) + 12;
    std::array<sock_filter, 6> program{{
        {BPF_LD | BPF_H | BPF_ABS, 0, 0, 0}, // source port
        {BPF_JMP | BPF_JEQ | BPF_K, 0, 3, source.port()},
        {BPF_LD | BPF_W | BPF_ABS, 0, 0, source_address},
        {BPF_JMP | BPF_JEQ | BPF_K, 0, 1, source.address().to_v4().to_uint()},
        {BPF_RET | BPF_K, 0, 0, 0},
        {BPF_RET | BPF_K, 0, 0, whole},
    }};
    attach(socket, program);
}

// Makes it drop everything that arrives.
void drop_all(udp::socket& socket) noexcept {
    std::array<sock_filter, 1> program{{{BPF_RET | BPF_K, 0, 0, 0}}};
    attach(socket, program);
}

// Ends either.
void drop_nothing(udp::socket& socket) noexcept {
    const int unused = 0;
    static_cast<void>(::setsockopt(socket.native_handle(), SOL_SOCKET, SO_DETACH_FILTER, &unused, sizeof unused));
}

core::group_source source_of(const udp::endpoint& end) {
    return {.address = end.address().to_v4().to_uint(), .port = end.port()};
}

} // namespace

// --- Receiving ---

/// The socket that receives a multicast group on one interface: that group and nothing else (no unicast, no other group
/// or interface), beside other programs of the host. All nodes on one executor share it, so that the system copies each
/// datagram once for them all.
class group_receiver : public std::enable_shared_from_this<group_receiver> {
  public:
    /// Joins the group. \throws boost::system::system_error
    [[gnu::cold]] group_receiver(const asio::any_io_executor& executor, const core::network_interface& by,
                                 const udp::endpoint& group);

    /// Starts to deliver to this listener too, up to a number of datagrams per turn; nothing is allocated for one
    /// except what parsing it keeps. The listener must live until it is removed. It need not receive what it sends
    /// itself from `source`; while it is the only one, the system drops that.
    [[gnu::cold]] void add(core::group_listener& listener, const core::group_source& source);
    /// Nothing more is delivered to it; may be called during delivery. With the last listener, the socket is closed.
    [[gnu::cold]] void remove(const core::group_listener& listener);

    [[nodiscard, gnu::cold]] bool is_for(const asio::any_io_executor& executor, const core::network_interface& by,
                                         const udp::endpoint& group);

  private:
    struct place {
        core::group_listener* events; // null: removed during delivery
        core::group_source source;
    };
    /// A datagram that was fetched.
    struct received_datagram {
        core::group_source from;
        std::string_view text;
        bool good = false;
        protocol::request_line request{};       // if it is good
        cles::detail::shared_reading reading{}; // of its body
    };

    [[gnu::cold]] void filter();
    void receive();
    void on_readable(error_code code);
    void deliver();
    void continue_soon();
    [[nodiscard]] bool fetch();
    void deliver_to_next();

    udp::endpoint group_;
    int interface_;
    udp::socket socket_;
    receive_batch arrived_;
    bool more_ = false; // more may have arrived
    std::vector<place> listeners_;
    std::size_t active_listeners_ = 0; // number of listeners that are not null
    bool delivering_ = false;
    std::vector<received_datagram> received_;
    std::size_t next_ = 0; // the first listener that has not received everything
    std::size_t at_ = 0;   // the first datagram that this one has not received
};

group_receiver::group_receiver(const asio::any_io_executor& executor, const core::network_interface& by,
                               const udp::endpoint& group)
    : group_(group), interface_(by.index), socket_(make_private<udp::socket>(executor, udp::v4())) {
    socket_.set_option(asio::socket_base::reuse_address{true});
    set_ip_option(socket_, IP_MULTICAST_ALL, 0); // otherwise it receives groups that other programs have joined
    socket_.bind(group_);
    set_ip_option(socket_, IP_ADD_MEMBERSHIP, membership(group_, interface_));
    receive_batch::prepare(socket_);
}

// Only its own executor may check whether the socket is open; for others, the first comparison fails.
bool group_receiver::is_for(const asio::any_io_executor& executor, const core::network_interface& by,
                            const udp::endpoint& group) {
    return socket_.get_executor() == executor && interface_ == by.index && group_ == group && socket_.is_open();
}

void group_receiver::add(core::group_listener& listener, const core::group_source& source) {
    listeners_.push_back({&listener, source});
    ++active_listeners_;
    filter();
    if (active_listeners_ == 1) {
        receive();
    }
}

void group_receiver::remove(const core::group_listener& listener) {
    const auto found =
        std::find_if(listeners_.begin(), listeners_.end(), [&](const auto& each) { return each.events == &listener; });
    if (found == listeners_.end()) {
        return;
    }
    if (delivering_) {
        found->events = nullptr; // the others keep their indices
    } else {
        listeners_.erase(found);
    }
    if (--active_listeners_ == 0) {
        error_code ignored;
        socket_.close(ignored);
    } else {
        filter();
    }
}

// Several listeners receive each other's datagrams; a single one need not receive its own.
void group_receiver::filter() {
    if (active_listeners_ == 1) {
        const auto alone =
            std::find_if(listeners_.begin(), listeners_.end(), [](const auto& each) { return each.events != nullptr; });
        drop_from(socket_, {asio::ip::address_v4{alone->source.address}, alone->source.port});
    } else {
        drop_nothing(socket_);
    }
}

void group_receiver::receive() {
    wait_call<&group_receiver::on_readable>(socket_, udp::socket::wait_read, shared_from_this());
}

void group_receiver::on_readable(error_code code) {
    if (!code) {
        more_ = true;
        next_ = listeners_.size(); // their number may have changed
        deliver();
    }
}

void group_receiver::continue_soon() {
    post_call<&group_receiver::deliver>(socket_.get_executor(), shared_from_this());
}

// User handlers run inside. So each listener receives what has arrived in a posted function of its own, and what it
// does there, or throws, is finished before the next is called. A single listener receives the next at once, up to a
// number.
void group_receiver::deliver() {
    constexpr std::size_t most = 256; // approximate, since fetches count as well
    delivering_ = true;
    try {
        for (std::size_t delivered = 0; delivered < most; delivered += received_.size() + 1) {
            if (next_ == listeners_.size() && !fetch()) {
                delivering_ = false;
                if (active_listeners_ != 0) {
                    receive();
                }
                return;
            }
            deliver_to_next();
            if (listeners_.size() > 1 && (next_ != listeners_.size() || more_)) {
                break;
            }
        }
    } catch (...) { // of a handler, for the thread that runs the context; other datagrams are not affected
        continue_soon();
        throw;
    }
    continue_soon();
}

// All listeners have received everything fetched. Returns false if there is no more.
bool group_receiver::fetch() {
    std::erase_if(listeners_, [](const auto& each) { return each.events == nullptr; });
    received_.clear();
    if (!more_ || active_listeners_ == 0) {
        next_ = listeners_.size();
        return false;
    }
    next_ = 0;
    more_ = arrived_.fetch(socket_);
    while (!arrived_.empty()) {
        const auto one = arrived_.take();
        auto& kept = received_.emplace_back(received_datagram{.from = source_of(one.from), .text = one.text});
        kept.good = protocol::parse_group_message(kept.text, kept.request);
    }
    return true;
}

void group_receiver::deliver_to_next() {
    while (at_ != received_.size() && listeners_[next_].events != nullptr) {
        auto& one = received_[at_++];
        one.request.reading = active_listeners_ > 1 ? &one.reading : nullptr;
        listeners_[next_].events->on_datagram({one.from, one.text, one.good ? &one.request : nullptr});
    }
    at_ = 0;
    ++next_;
}

namespace {

/// The receivers of one context.
class group_receivers final : public asio::detail::execution_context_service_base<group_receivers> {
  public:
    explicit group_receivers(asio::execution_context& context) : execution_context_service_base(context) {}

    std::shared_ptr<group_receiver> find(const asio::any_io_executor& executor, const core::network_interface& by,
                                         const udp::endpoint& group) {
        const std::lock_guard lock{mutex_}; // executors of one context may be used by several threads
        std::erase_if(all_, [](const auto& each) { return each.expired(); });
        for (const auto& each : all_) {
            if (auto one = each.lock(); one && one->is_for(executor, by, group)) {
                return one;
            }
        }
        auto made = std::make_shared<group_receiver>(executor, by, group);
        all_.push_back(made);
        return made;
    }

  private:
    void shutdown() noexcept override {}

    std::mutex mutex_;
    std::vector<std::weak_ptr<group_receiver>> all_;
};

} // namespace

[[gnu::cold]] std::shared_ptr<group_receiver>
receiver_of(const asio::any_io_executor& executor, const core::network_interface& by, const udp::endpoint& group) {
    auto& context = asio::query(executor, asio::execution::context);
    return asio::use_service<group_receivers>(context).find(executor, by, group);
}

// --- Sending ---

group_port::group_port(const asio::any_io_executor& executor, const core::network_interface& by,
                       const multicast_options& where)
    : group_(asio::ip::make_address_v4(where.group), where.port), receiver_(receiver_of(executor, by, group_)),
      own_(make_private<udp::socket>(executor, udp::v4())), burst_(own_) {
    own_.bind({asio::ip::address_v4{by.address}, 0});
    set_ip_option(own_, IP_MULTICAST_IF, membership(group_, by.index));
    set_ip_option(own_, IP_MULTICAST_TTL, 1);
    set_ip_option(own_, IP_MULTICAST_LOOP, 1); // for other nodes of this host
    own_.non_blocking(true);
    drop_all(own_); // nothing reads from it
    source_ = source_of(own_.local_endpoint());
}

void group_port::start(core::group_listener& owner) {
    owner_ = &owner;
    receiver_->add(owner, source_);
}

void group_port::close() {
    if (const auto* const owner = std::exchange(owner_, nullptr)) {
        receiver_->remove(*owner);
    }
    receiver_.reset();
    error_code ignored;
    own_.close(ignored);
}

core::datagrams_done group_port::send(core::datagram_list all) {
    if (!own_.is_open()) {
        return {.bytes = all.bytes().size()}; // all of it is lost
    }
    auto taken = unsent() == 0 ? burst_.send_all(all, &group_) : core::datagrams_done{};
    if (const auto before = std::exchange(failed_, 0); before != 0) {
        taken.why = taken.failed != 0 ? taken.why : why_;
        taken.failed += before;
    }
    for (auto sent = taken.count; sent != 0; --sent) {
        all.drop_first();
    }
    while (!all.empty()) {
        const auto one = all.first();
        if (unsent() + one.size() > max_waiting) {
            break;
        }
        waiting_.append(one);
        waiting_sizes_.push_back(static_cast<std::uint16_t>(one.size()));
        ++taken.count;
        taken.bytes += one.size();
        all.drop_first();
    }
    wait_until_writable();
    return taken;
}

void group_port::send_to(const core::group_source& to, std::string_view datagram) {
    error_code ignored;
    if (own_.is_open()) {
        own_.send_to(asio::buffer(datagram), {asio::ip::address_v4{to.address}, to.port}, 0, ignored);
    }
}

void group_port::wait_until_writable() {
    if (unsent() == 0 || waits_until_writable_) {
        return;
    }
    waits_until_writable_ = true;
    wait_call<&group_port::on_writable>(own_, udp::socket::wait_write, shared_from_this());
}

void group_port::on_writable(error_code code) {
    waits_until_writable_ = false;
    if (!code && owner_ != nullptr) {
        send_rest();
        if (unsent() == 0 && owner_ != nullptr) {
            owner_->on_writable();
        }
    }
}

void group_port::send_rest() {
    const auto done = burst_.send_all({std::string_view{waiting_}.substr(waiting_at_),
                                       std::span<const std::uint16_t>{waiting_sizes_}.subspan(waiting_sent_)},
                                      &group_);
    waiting_at_ += done.bytes;
    waiting_sent_ += done.count;
    if (done.failed != 0) {
        failed_ += done.failed;
        why_ = done.why;
    }
    if (unsent() != 0) {
        wait_until_writable();
        return;
    }
    waiting_.clear();
    waiting_sizes_.clear();
    waiting_at_ = 0;
    waiting_sent_ = 0;
}

// --- What is sent to this node alone ---

void group_port::receive_own() {
    if (!own_arrived_ && own_.is_open()) {
        own_arrived_.emplace();
        receive_batch::prepare(own_);
        drop_nothing(own_);
        wait_for_own();
    }
}

void group_port::wait_for_own() { wait_call<&group_port::on_own>(own_, udp::socket::wait_read, shared_from_this()); }

void group_port::on_own(error_code code) {
    if (!code) {
        deliver_own();
    }
}

void group_port::deliver_own() {
    const bool all = own_arrived_->hand_over_in_turns(
        own_,
        [this](const receive_batch::datagram& one) {
            if (owner_ != nullptr) {
                const auto from = source_of(one.from);
                owner_->on_datagram({.from = from, .text = one.text, .request = nullptr, .to_group = false});
            }
        },
        [this] { post_call<&group_port::deliver_own>(own_.get_executor(), shared_from_this()); });
    if (all && own_.is_open()) {
        wait_for_own();
    }
}

} // namespace cles::transport
