// SPDX-License-Identifier: BSL-1.0
#include "transport/group_receiver.hpp"

#include "protocol/group_message.hpp"
#include "transport/group_socket_option.hpp"
#include "transport/source_filter.hpp"

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

/// Those of one context.
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
    set_ip_option(socket_, IP_MULTICAST_ALL, 0); // else it receives groups that other programs have joined
    socket_.bind(group_);
    set_ip_option(socket_, IP_ADD_MEMBERSHIP, membership(group_, interface_));
    socket_.non_blocking(true);
    error_code ignored;
    constexpr int room = 1 << 20; // a burst waits here while others have their turn
    socket_.set_option(asio::socket_base::receive_buffer_size{room}, ignored);
    datagram_batch::keep_together(socket_);
}

// Only its own executor may ask whether the socket is open; from others the executor differs.
bool group_receiver::is_for(const asio::any_io_executor& executor, const core::network_interface& by,
                            const udp::endpoint& group) {
    return socket_.get_executor() == executor && interface_ == by.index && group_ == group && socket_.is_open();
}

void group_receiver::add(core::group_listener& listener, const core::group_source& source) {
    listeners_.push_back({&listener, source});
    ++hearing_;
    filter();
    if (hearing_ == 1) {
        receive();
    }
}

void group_receiver::remove(const core::group_listener& listener) {
    const auto found =
        std::find_if(listeners_.begin(), listeners_.end(), [&](const auto& each) { return each.events == &listener; });
    if (found == listeners_.end()) {
        return;
    }
    if (telling_) {
        found->events = nullptr; // the others keep their places
    } else {
        listeners_.erase(found);
    }
    if (--hearing_ == 0) {
        error_code ignored;
        socket_.close(ignored);
    } else {
        filter();
    }
}

// What one sends the others are to hear.
void group_receiver::filter() {
    if (hearing_ == 1) {
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
            self->next_ = self->listeners_.size(); // the number may be another by now
            self->hand_over();
        }
    });
}

void group_receiver::go_on_soon() {
    asio::post(socket_.get_executor(), [self = shared_from_this()] { self->hand_over(); });
}

// The program's handlers run in it. So each listener is given what has come in a function of its own, and what one does
// there, or throws, is done before the next is called; a single listener is given the next at once, up to a number.
void group_receiver::hand_over() {
    constexpr std::size_t most = 256; // about, since fetches count as well; then others have their turn
    telling_ = true;
    try {
        for (std::size_t told = 0; told < most; told += heard_.size() + 1) {
            if (next_ == listeners_.size() && !fetch()) {
                telling_ = false;
                if (hearing_ != 0) {
                    receive();
                }
                return;
            }
            tell_next();
            if (listeners_.size() > 1 && (next_ != listeners_.size() || more_)) {
                break;
            }
        }
    } catch (...) { // a handler's, for the thread that runs the context; what else has come is not affected
        go_on_soon();
        throw;
    }
    go_on_soon();
}

// All have heard what was there. False: no more is.
bool group_receiver::fetch() {
    std::erase_if(listeners_, [](const auto& each) { return each.events == nullptr; });
    heard_.clear();
    const bool may = more_ && hearing_ != 0;
    next_ = may ? 0 : listeners_.size();
    if (may) {
        more_ = arrived_.fetch(socket_);
        while (!arrived_.empty()) {
            const auto one = arrived_.take();
            auto& kept = heard_.emplace_back(heard{.from = source_of(one.from), .text = one.text});
            kept.good = protocol::parse_group_message(kept.text, kept.said);
        }
    }
    return may;
}

void group_receiver::tell_next() {
    const auto events = [this] { return listeners_[next_].events; };
    while (at_ != heard_.size() && events() != nullptr) {
        auto& one = heard_[at_++];
        one.said.reading = hearing_ > 1 ? &one.reading : nullptr;
        events()->on_datagram({one.from, one.text, one.good ? &one.said : nullptr});
    }
    at_ = 0;
    if (auto* const told = listeners_[next_++].events; told != nullptr) {
        told->on_batch();
    }
}

} // namespace cles::transport
