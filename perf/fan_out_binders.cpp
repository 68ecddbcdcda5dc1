// SPDX-License-Identifier: BSL-1.0
#include "fan_out_binders.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>

#include <algorithm>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

namespace cles::perf {

namespace asio = boost::asio;

namespace {

constexpr std::chrono::seconds patience{60}; // beyond what publishing takes by the clock
constexpr std::chrono::hours longest_deadline{24};

/// What the binders of one pass share.
class gathering {
  public:
    gathering(asio::io_context& io, cles::service& client, const fan_out_order& order, latency_recorder* record)
        : all(record), io_(io), client_(client), order_(order), quiet_(io) {}

    arrivals all;

    [[nodiscard]] std::uint64_t updates() const noexcept { return order_.updates; }
    /// Whether it was published in this pass; the last one of an earlier pass may be repeated.
    [[nodiscard]] bool is_new(const publication& value) const noexcept { return value.published_ns >= began_; }

    void bound() {
        if (++bound_ < order_.binders) {
            return;
        }
        const auto by_the_clock = std::chrono::nanoseconds{order_.interval_ns} * order_.updates;
        const auto deadline = std::chrono::ceil<std::chrono::milliseconds>(by_the_clock) + patience;
        client_.async_push("car1:publish", order_,
                           call_options{}.deadline(std::min<std::chrono::milliseconds>(deadline, longest_deadline)),
                           [this](boost::system::error_code code, const json_text&) {
                               if (code) {
                                   fail(std::make_exception_ptr(cles::error(code, "the PUSH that starts the updates")));
                                   return;
                               }
                               published_ = true;
                               if (!leave()) {
                                   asio::co_spawn(io_, wait_for_silence(), [](const std::exception_ptr&) {});
                               }
                           });
    }

    void complete() {
        ++complete_;
        leave();
    }

    void fail(std::exception_ptr failure) {
        failure_ = std::move(failure);
        end();
    }

    [[nodiscard]] const std::exception_ptr& failure() const noexcept { return failure_; }

  private:
    // The next pass must not begin before the publisher has ended this one.
    bool leave() {
        const bool over = published_ && complete_ == order_.binders;
        if (over) {
            end();
        }
        return over;
    }

    void end() {
        quiet_.cancel();
        io_.stop();
    }

    asio::awaitable<void> wait_for_silence() {
        for (std::uint64_t before = 0;;) {
            before = all.count();
            quiet_.expires_after(silence);
            co_await quiet_.async_wait(asio::use_awaitable);
            if (all.count() == before) {
                io_.stop();
                co_return;
            }
        }
    }

    asio::io_context& io_;
    cles::service& client_;
    const fan_out_order& order_;
    asio::steady_timer quiet_;
    std::int64_t began_ = monotonic_ns();
    std::uint64_t bound_ = 0;
    std::uint64_t complete_ = 0;
    bool published_ = false;
    std::exception_ptr failure_;
};

class binder {
  public:
    binder(gathering& all, const fan_out_binding& binding) : all_(all), binding_(binding) {}

    void start(asio::io_context& io, cles::service& client) {
        asio::co_spawn(io, bind(client), [this](std::exception_ptr failure) {
            if (failure) {
                all_.fail(std::move(failure));
            }
        });
    }

    void close() { feed_.close(); }

  private:
    asio::awaitable<void> bind(cles::service& client) {
        bind_options options;
        if (binding_.keep != 0) {
            options.keep(binding_.keep);
        }
        feed_ = co_await client.async_bind<publication>("car1:localization", options);
        all_.bound();
        if (binding_.style == handler_style::callback) {
            next();
            co_return;
        }
        for (bool more = true; more;) {
            const auto item = co_await feed_.async_next();
            more = take(item);
        }
    }

    void next() {
        feed_.async_next([this](boost::system::error_code code, const feed_item<publication>& item) {
            if (code) {
                all_.fail(std::make_exception_ptr(cles::error(code, "a feed failed")));
                return;
            }
            try {
                if (take(item)) {
                    next();
                }
            } catch (...) {
                all_.fail(std::current_exception());
            }
        });
    }

    /// False once the last update has come, or is known to be lost.
    bool take(const feed_item<publication>& item) {
        if (item.kind == feed_event::lost) {
            throw std::runtime_error("the publisher was lost: " + item.text);
        }
        seen_ += item.missed;
        if (item.kind == feed_event::update && all_.is_new(item.value)) {
            all_.all.take(item.value);
            ++seen_;
        }
        if (seen_ < all_.updates()) {
            return true;
        }
        all_.complete();
        return false;
    }

    gathering& all_;
    const fan_out_binding& binding_;
    feed<publication> feed_;
    std::uint64_t seen_ = 0;
};

} // namespace

fan_out_tally take_fan_out(asio::io_context& io, const std::vector<cles::service*>& clients, const fan_out_order& order,
                           const fan_out_binding& binding, latency_recorder* record) {
    gathering all{io, *clients.front(), order, record};
    std::vector<std::unique_ptr<binder>> binders;
    for (std::uint64_t i = 0; i < order.binders; ++i) {
        binders.push_back(std::make_unique<binder>(all, binding));
        binders.back()->start(io, *clients[i % clients.size()]);
    }
    io.restart();
    run(io, binding.how);
    // What is still under way refers to the binders.
    if (all.failure()) {
        for (auto* const each : clients) {
            each->stop();
        }
    }
    for (auto& each : binders) {
        each->close();
    }
    io.restart();
    io.poll();
    if (all.failure()) {
        std::rethrow_exception(all.failure());
    }
    return all.all.tally();
}

} // namespace cles::perf
