// SPDX-License-Identifier: BSL-1.0
#include "transport/group_receiver.hpp"

#include "protocol/datagram.hpp"
#include "transport/multicast_socket.hpp"

#include <boost/asio/execution/context.hpp>
#include <boost/asio/execution_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/query.hpp>

#include <algorithm>
#include <mutex>

namespace cles::transport {
namespace asio = boost::asio;
using boost::system::error_code;

namespace {

/// The receivers of one context.
class group_receivers final : public asio::execution_context::service {
  public:
    using key_type = group_receivers;
    static inline asio::execution_context::id id;

    explicit group_receivers(asio::execution_context& context) : service(context) {}

    std::shared_ptr<group_receiver> find(const asio::any_io_executor& executor, const core::network_interface& by,
                                         const asio::ip::udp::endpoint& group) {
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

core::group_source source_of(const asio::ip::udp::endpoint& end) {
    return {.address = end.address().to_v4().to_uint(), .port = end.port()};
}

std::shared_ptr<group_receiver> group_receiver::of(const asio::any_io_executor& executor,
                                                   const core::network_interface& by, const udp::endpoint& group) {
    auto& context = asio::query(executor, asio::execution::context);
    return asio::use_service<group_receivers>(context).find(executor, by, group);
}

group_receiver::group_receiver(const asio::any_io_executor& executor, const core::network_interface& by,
                               const udp::endpoint& group)
    : group_(group), interface_(by.index), socket_(executor, udp::v4()) {
    socket_.set_option(asio::socket_base::reuse_address{true});
    set_ip_option(socket_, IP_MULTICAST_ALL, 0); // otherwise it receives groups that other programs have joined
    socket_.bind(group_);
    set_ip_option(socket_, IP_ADD_MEMBERSHIP, membership(group_, interface_));
    socket_.non_blocking(true);
    error_code ignored;
    constexpr int room = 1 << 20; // a burst waits here while other tasks run
    socket_.set_option(asio::socket_base::receive_buffer_size{room}, ignored);
    receive_batch::enable_gro(socket_);
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
    socket_.async_wait(udp::socket::wait_read, [self = shared_from_this()](error_code code) {
        if (!code) {
            self->more_ = true;
            self->next_ = self->listeners_.size(); // their number may have changed
            self->deliver();
        }
    });
}

void group_receiver::continue_soon() {
    asio::post(socket_.get_executor(), [self = shared_from_this()] { self->deliver(); });
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
    const bool may = more_ && active_listeners_ != 0;
    next_ = may ? 0 : listeners_.size();
    if (may) {
        more_ = arrived_.fetch(socket_);
        while (!arrived_.empty()) {
            const auto one = arrived_.take();
            auto& kept = received_.emplace_back(received_datagram{.from = source_of(one.from), .text = one.text});
            kept.good = protocol::parse_group_message(kept.text, kept.request);
        }
    }
    return may;
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

} // namespace cles::transport
