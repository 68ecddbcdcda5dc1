// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_batch.hpp>
#include <cles/run.hpp>
#include <cles/service.hpp>

#include "perf/support/handler_style.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>

#include <cstdint>
#include <exception>

/// What the measurements of feeds have in common.
namespace cles::perf {

/// A feed of "car1:localization": `take` of the derived class gets what it receives, until that returns false. The
/// pass, which all readers share, gets `bound()` once, and `fail(std::exception_ptr)`.
template <class Derived, class T, class Pass>
class feed_reader {
  public:
    /// \param keep updates that the publisher queues for a slow reader; 0: the protocol's default
    feed_reader(Pass& all, handler_style style, std::uint32_t keep, bool multicast = false) : all_(all), style_(style) {
        if (keep != 0) {
            options_.keep(keep);
        }
        options_.multicast(multicast);
    }

    void start(boost::asio::io_context& io, cles::service& client) {
        boost::asio::co_spawn(io, read(client), [this](std::exception_ptr failure) {
            if (failure) {
                all_.fail(std::move(failure));
            }
        });
    }

    void close() { feed_.close(); }

  protected:
    Pass& all_;

  private:
    bool take(const feed_item<T>& item) { return static_cast<Derived*>(this)->take(item); }

    boost::asio::awaitable<void> read(cles::service& client) {
        feed_ = co_await client.async_bind<T>("car1:localization", options_);
        all_.bound();
        if (style_ == handler_style::batch) {
            next_batch();
            co_return;
        }
        if (style_ == handler_style::callback) {
            next();
            co_return;
        }
        for (bool more = true; more;) {
            const auto item = co_await feed_.async_next();
            more = take(item);
        }
    }

    void next() {
        feed_.async_next([this](boost::system::error_code code, const feed_item<T>& item) {
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

    void next_batch() {
        feed_.async_next_batch([this](boost::system::error_code code, const feed_batch<T>& items) {
            if (code) {
                all_.fail(std::make_exception_ptr(cles::error(code, "a feed failed")));
                return;
            }
            try {
                for (const auto& item : items) {
                    if (!take(item)) {
                        return;
                    }
                }
                next_batch();
            } catch (...) {
                all_.fail(std::current_exception());
            }
        });
    }

    handler_style style_;
    bind_options options_;
    feed<T> feed_;
};

/// Runs the context until the pass stops it, and ends everything that refers to the readers. Rethrows the pass's
/// failure.
template <class Pass, class Clients, class Readers>
void run_pass(boost::asio::io_context& io, const run_options& how, const Pass& all, const Clients& clients,
              const Readers& readers) {
    io.restart();
    run(io, how);
    if (all.failure()) {
        for (const auto& each : clients) {
            each->stop();
        }
    }
    for (const auto& each : readers) {
        each->close();
    }
    io.restart();
    io.poll();
    if (all.failure()) {
        std::rethrow_exception(all.failure());
    }
}

} // namespace cles::perf
