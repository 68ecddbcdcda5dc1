// SPDX-License-Identifier: BSL-1.0
#include "client/feed_set.hpp"

#include <cles/error.hpp>
#include <cles/identity.hpp>
#include <cles/service.hpp>

#include "client/client.hpp"
#include "output/errors.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/system/system_error.hpp>

#include <algorithm>
#include <cstddef>
#include <exception>
#include <map>
#include <utility>

namespace tool {

namespace asio = boost::asio;
using namespace std::chrono_literals;

namespace {

constexpr std::chrono::milliseconds first_retry{500};
constexpr std::chrono::milliseconds longest_retry{5000};

// It may still come: the node, the task, or the link.
bool may_come_later(boost::system::error_code why) {
    if (why.category() == cles::untrusted_listener_category()) {
        return false; // only --local-user changes that
    }
    if (why.category() != cles::error_category()) {
        return true; // of the system, such as a refused connection
    }
    return why == cles::errc::no_target || why == cles::errc::no_task || why == cles::errc::unavailable ||
           why == cles::errc::busy || why == cles::errc::deadline;
}

} // namespace

class feed_set::state : public std::enable_shared_from_this<feed_set::state> {
  public:
    state(client& requester, receiver on_item, bound_function on_bound)
        : requester_(requester), on_item_(std::move(on_item)), on_bound_(std::move(on_bound)),
          woken_(requester.context(), asio::steady_timer::time_point::max()) {}

    void add(const std::string& noun, const cles::bind_options& options, failing how) {
        const auto made = std::make_shared<entry>(noun, options, how, requester_.context());
        if (entries_.emplace(noun, made).second) {
            bind(made);
        }
    }
    [[nodiscard]] bool contains(const std::string& noun) const { return entries_.contains(noun); }
    [[nodiscard]] std::size_t size() const noexcept { return entries_.size(); }

    void close() {
        is_closed_ = true;
        for (const auto& [noun, each] : entries_) {
            each->feed.close();
            each->retry.cancel();
        }
        entries_.clear();
    }

    asio::awaitable<bool> wait_until(std::chrono::steady_clock::time_point when) {
        boost::system::error_code code;
        if (!has_ended_ && !failure_) {
            woken_.expires_at(when);
            co_await woken_.async_wait(asio::redirect_error(asio::use_awaitable, code));
        }
        if (failure_) {
            std::rethrow_exception(failure_);
        }
        if (!has_ended_ && code) { // interrupted
            throw boost::system::system_error(code);
        }
        co_return has_ended_;
    }

  private:
    struct entry {
        entry(const std::string& of, const cles::bind_options& how_to_bind, failing how, asio::io_context& io)
            : noun(of), options(how_to_bind), if_it_fails(how), retry(io) {}

        [[nodiscard]] bool waits() const {
            return if_it_fails == failing::waits || if_it_fails == failing::waits_or_leaves_out;
        }

        const std::string noun;
        const cles::bind_options options;
        const failing if_it_fails;
        asio::steady_timer retry;
        std::chrono::milliseconds delay = first_retry;
        std::string words{}; // of the node that refuses
        cles::feed<cles::json_text> feed{};
    };

    void bind(const std::shared_ptr<entry>& what) {
        what->words.clear();
        auto options = what->options;
        options.diagnostics(what->words);
        requester_.node().async_bind(
            what->noun, options,
            [self = shared_from_this(), what](boost::system::error_code code, cles::feed<cles::json_text> bound) {
                self->on_bound(what, code, std::move(bound));
            });
    }

    void on_bound(const std::shared_ptr<entry>& what, boost::system::error_code code,
                  cles::feed<cles::json_text> bound) {
        if (is_closed_) {
            return;
        }
        if (!code) {
            what->feed = std::move(bound);
            if (on_bound_) {
                on_bound_(what->noun);
            }
            next(what);
        } else if (what->waits() && may_come_later(code)) {
            try_again_later(what);
        } else if (is_left_out(*what)) {
            ++left_out_;
            note(what->noun + ": " + cles::error(code, text_of(*what, code)).what());
        } else {
            fail(std::make_exception_ptr(cles::error(code, text_of(*what, code))));
        }
    }

    // Without any noun that is left, nothing would ever come.
    [[nodiscard]] bool is_left_out(const entry& failed) const {
        const bool is_last = left_out_ + 1 == entries_.size();
        return failed.if_it_fails == failing::waits_or_leaves_out ||
               (failed.if_it_fails == failing::leaves_out && !is_last);
    }

    static std::string text_of(const entry& what, boost::system::error_code code) {
        return what.words.empty() ? code.message() : what.words;
    }

    void try_again_later(const std::shared_ptr<entry>& what) {
        what->retry.expires_after(what->delay);
        what->delay = std::min(what->delay * 2, longest_retry);
        what->retry.async_wait([self = shared_from_this(), what](boost::system::error_code code) {
            if (!code && !self->is_closed_) {
                self->bind(what);
            }
        });
    }

    void next(const std::shared_ptr<entry>& what) {
        what->feed.async_next([self = shared_from_this(), what](boost::system::error_code code, const item& event) {
            self->on_event(what, code, event);
        });
    }

    void on_event(const std::shared_ptr<entry>& what, boost::system::error_code code, const item& event) {
        if (is_closed_) {
            return;
        }
        if (code) {
            fail(std::make_exception_ptr(cles::error(code, what->noun + ": " + code.message())));
            return;
        }
        try {
            has_ended_ = has_ended_ || !on_item_(what->noun, event);
        } catch (...) { // such as that the reader of the output is gone
            fail(std::current_exception());
            return;
        }
        if (has_ended_) {
            woken_.cancel();
        } else {
            next(what);
        }
    }

    void fail(std::exception_ptr why) {
        if (!failure_) {
            failure_ = std::move(why);
        }
        woken_.cancel();
    }

    client& requester_;
    const receiver on_item_;
    const bound_function on_bound_;
    asio::steady_timer woken_;
    std::map<std::string, std::shared_ptr<entry>> entries_;
    std::size_t left_out_ = 0; // of them
    std::exception_ptr failure_;
    bool has_ended_ = false;
    bool is_closed_ = false;
};

feed_set::feed_set(client& requester, receiver on_item, bound_function on_bound)
    : state_(std::make_shared<state>(requester, std::move(on_item), std::move(on_bound))) {}

feed_set::~feed_set() { state_->close(); }

void feed_set::add(const std::string& noun, const cles::bind_options& options, failing how) {
    state_->add(noun, options, how);
}

bool feed_set::contains(const std::string& noun) const { return state_->contains(noun); }

std::size_t feed_set::size() const noexcept { return state_->size(); }

asio::awaitable<bool> feed_set::wait_until(std::chrono::steady_clock::time_point when) {
    const bool has_ended = co_await state_->wait_until(when);
    co_return has_ended;
}

} // namespace tool
