// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/update_gathering.hpp"
#include "shell/connection.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace cles::detail {
class engine;
}

namespace cles::shell {

/// When what a service has to say is written: together, in a turn of its executor that follows what runs now. What is
/// alone goes at once, in the call that said it: it has nothing to be gathered with, and until the next turn its
/// caller may do much that it would have to wait for, such as setting a timer.
class turns {
  public:
    explicit turns(detail::engine& host) noexcept : host_(host) {}
    turns(const turns&) = delete;
    turns& operator=(const turns&) = delete;

    /// Has what waits carried on when what runs now has ended.
    void ask();
    /// Has a connection's output written then.
    void flush_soon(connection& c);
    /// Lets a caller of the service publish or ask for something. What that throws passes through. No handler and no
    /// operation runs in it.
    template <class F>
    void let(F&& say) {
        if (asked_) { // others wait already
            std::forward<F>(say)();
            return;
        }
        try {
            const held during{*this};
            std::forward<F>(say)();
        } catch (...) {
            ask_if_something_waits();
            throw;
        }
        say_at_once();
    }
    /// Writes the last. From now on there are no more turns.
    void stop();

  private:
    /// While it stands no turn is posted: whoever made it sees to what waits.
    class held {
      public:
        explicit held(turns& of) noexcept : of_(of), asked_(std::exchange(of.asked_, true)) {}
        held(const held&) = delete;
        held& operator=(const held&) = delete;
        ~held() { of_.asked_ = asked_; }

      private:
        turns& of_;
        bool asked_;
    };

    void turn();
    void let_publishers_go_on();
    void say_at_once();
    /// Puts what has been published to its binders. How much it was in all; none: nothing, or it waits for more.
    std::optional<std::uint64_t> publish(bool alone);
    void ask_if_something_waits();

    detail::engine& host_;
    core::update_gathering gathering_;
    std::vector<std::shared_ptr<connection>> to_flush_;
    std::vector<std::shared_ptr<connection>> flushing_;
    bool asked_ = false;
};

} // namespace cles::shell
