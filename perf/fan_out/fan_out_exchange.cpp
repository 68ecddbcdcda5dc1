// SPDX-License-Identifier: BSL-1.0
#include "fan_out_exchange.hpp"

#include "feed_reader.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <algorithm>
#include <exception>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

namespace cles::perf {

namespace asio = boost::asio;

namespace {

asio::awaitable<void> publish_paced(cles::service& car, fan_out_order order) {
    asio::steady_timer clock{car.get_executor(), asio::steady_timer::clock_type::now()};
    for (std::uint64_t i = 0; i < order.updates; ++i) {
        clock.expires_at(clock.expiry() + std::chrono::nanoseconds{order.interval_ns});
        co_await clock.async_wait(asio::use_awaitable);
        car.update("localization", publish_sample(i));
    }
}

asio::awaitable<void> publish_flat_out(cles::service& car, std::uint64_t updates) {
    for (std::uint64_t i = 0; i < updates; ++i) {
        co_await car.async_update("localization", publish_sample(i));
    }
}

constexpr std::chrono::seconds patience{60}; // longer than publishing takes
constexpr std::chrono::hours longest_deadline{24};
constexpr std::chrono::milliseconds between_attempts{10};
constexpr auto not_yet = std::numeric_limits<std::int64_t>::max();

/// What the binders of one pass share.
class fan_out_pass {
  public:
    fan_out_pass(asio::io_context& io, cles::service& client, const fan_out_order& order, bool by_group,
                 latency_recorder* record)
        : all(record), io_(io), client_(client), order_(order), by_group_(by_group), timer_(io) {}

    arrivals all;

    [[nodiscard]] std::uint64_t updates() const noexcept { return order_.updates; }
    /// Whether it was published in this pass; earlier updates may still arrive.
    [[nodiscard]] bool is_new(const publication& value) const noexcept { return value.published_ns >= began_; }

    void bound() {
        if (++bound_ == order_.binders) {
            asio::co_spawn(io_, run_pass(), [this](std::exception_ptr failure) {
                if (failure) {
                    fail(std::move(failure));
                }
            });
        }
    }

    /// A binder has received its first update.
    void reached() { ++reached_; }

    void complete() {
        if (++complete_ == order_.binders) {
            timer_.cancel(); // ends a wait for silence
        }
    }

    void fail(std::exception_ptr failure) {
        if (over_) {
            return; // feeds that are still waiting were closed, or it follows from the first failure
        }
        over_ = true;
        failure_ = std::move(failure);
        timer_.cancel();
        io_.stop();
    }

    [[nodiscard]] bool has_begun() const noexcept { return began_ != not_yet; }

    [[nodiscard]] const std::exception_ptr& failure() const noexcept { return failure_; }

  private:
    asio::awaitable<void> run_pass() {
        if (by_group_) {
            co_await reach_all();
        }
        began_ = monotonic_ns();
        const auto by_the_clock = std::chrono::nanoseconds{order_.interval_ns} * order_.updates;
        const auto wanted = std::chrono::ceil<std::chrono::milliseconds>(by_the_clock) + patience;
        auto options = call_options{}.deadline(std::min<std::chrono::milliseconds>(wanted, longest_deadline));
        co_await client_.async_push("car1:publish", order_, options);
        co_await wait_for_silence();
        over_ = true;
        io_.stop();
    }

    // A BIND by the group has no reply: the first update shows that it has taken effect.
    asio::awaitable<void> reach_all() {
        const fan_out_order one{.binders = order_.binders, .updates = 1};
        while (reached_ < order_.binders) {
            co_await client_.async_push("car1:publish", one);
            timer_.expires_after(between_attempts);
            co_await timer_.async_wait(asio::use_awaitable);
        }
    }

    // Until the pass is complete, or nothing arrives any more.
    asio::awaitable<void> wait_for_silence() {
        for (auto before = all.count(); complete_ < order_.binders; before = all.count()) {
            timer_.expires_after(silence);
            boost::system::error_code cancelled;
            co_await timer_.async_wait(asio::redirect_error(asio::use_awaitable, cancelled));
            if (!cancelled && all.count() == before) {
                co_return;
            }
        }
    }

    asio::io_context& io_;
    cles::service& client_;
    const fan_out_order& order_;
    bool by_group_;
    asio::steady_timer timer_;
    std::int64_t began_ = not_yet;
    std::uint64_t bound_ = 0;
    std::uint64_t reached_ = 0;
    std::uint64_t complete_ = 0;
    bool over_ = false;
    std::exception_ptr failure_;
};

class fan_out_binder : public feed_reader<fan_out_binder, publication, fan_out_pass> {
  public:
    using feed_reader::feed_reader;

    /// False when the last update has arrived, or is known to be lost.
    bool take(const feed_item<publication>& item) {
        if (item.kind == feed_event::lost) {
            throw std::runtime_error("the publisher was lost: " + item.text);
        }
        if (item.kind == feed_event::update && !reached_) {
            reached_ = true;
            all_.reached();
        }
        if (item.kind == feed_event::update && all_.is_new(item.value)) {
            all_.all.take(item.value);
            ++seen_;
        } else if (item.kind == feed_event::gap && all_.has_begun()) {
            seen_ += item.missed;
        }
        if (seen_ < all_.updates()) {
            return true;
        }
        all_.complete();
        return false;
    }

  private:
    bool reached_ = false;
    std::uint64_t seen_ = 0;
};

} // namespace

void serve_fan_out(service_options options, const run_options& how, const child_process::announce& announce) {
    asio::io_context io{1};
    cles::service car{io, options};
    car.on_bind("localization");
    car.on_push("publish", [&car](fan_out_order order) {
        return order.interval_ns != 0 ? publish_paced(car, order) : publish_flat_out(car, order.updates);
    });
    announce(car.endpoints().front());
    run(io, how);
}

fan_out_tally take_fan_out(asio::io_context& io, const std::vector<cles::service*>& clients, const fan_out_order& order,
                           const fan_out_binding& binding, latency_recorder* record) {
    fan_out_pass all{io, *clients.front(), order, binding.multicast, record};
    std::vector<std::unique_ptr<fan_out_binder>> binders;
    for (std::uint64_t i = 0; i < order.binders; ++i) {
        binders.push_back(std::make_unique<fan_out_binder>(all, binding.style, binding.keep, binding.multicast));
        binders.back()->start(io, *clients[i % clients.size()]);
    }
    run_pass(io, binding.how, all, clients, binders);
    return all.all.tally();
}

} // namespace cles::perf
