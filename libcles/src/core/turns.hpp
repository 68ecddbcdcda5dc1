// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/publications.hpp"
#include "core/update_gathering.hpp"
#include "port/clock.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace cles::core {

/// What has output that is written in turns: a link.
class turn_taker {
  public:
    turn_taker() = default;
    turn_taker(const turn_taker&) = delete;
    turn_taker& operator=(const turn_taker&) = delete;

    /// Writes what is there, and has more served and published where there is room again.
    virtual void flush() = 0;
    /// Writes what is there; no handler runs. False where `flush` would do more.
    [[nodiscard]] virtual bool write() = 0;
    /// Whether no other request of this node's waits here for its answer.
    [[nodiscard]] virtual bool asks_alone() = 0;
    /// Keeps it.
    [[nodiscard]] virtual std::shared_ptr<turn_taker> share() = 0;

  protected:
    ~turn_taker() = default;

  private:
    friend class turns;
    bool waits_ = false; // for the next turn
};

/// What a service has turns by.
class turn_host {
  public:
    turn_host() = default;
    turn_host(const turn_host&) = delete;
    turn_host& operator=(const turn_host&) = delete;

    /// Has `turns::turn` called when what runs now has ended.
    virtual void post_turn() = 0;
    /// There are no more turns.
    [[nodiscard]] virtual bool stopped() const = 0;
    [[nodiscard]] virtual publications& published() = 0;
    /// Carries on what waits to be passed on to other nodes, or to begin here. Handlers run.
    virtual void route_on(time_point now) = 0;
    /// Something has happened.
    virtual void settle() = 0;

  protected:
    ~turn_host() = default;
};

/// When what a service has to say is written: together, in a turn of its executor that follows what runs now.
///
/// An update or a request of the program's own that is alone goes at once, in the call that said it: it has nothing to
/// be gathered with, and until the next turn its caller may do much that it would have to wait for, such as setting a
/// timer. But not while a handler runs, until it first waits for something: an answer that it gives then goes first.
class turns {
  public:
    turns(turn_host& host, const clock& time) noexcept : host_(host), time_(time) {}
    turns(const turns&) = delete;
    turns& operator=(const turns&) = delete;

    /// Has what waits carried on when what runs now has ended.
    void ask();
    /// Has output written then.
    void flush_soon(turn_taker& which);
    /// Carries on what waits. What a handler throws passes through; the rest has another turn.
    void turn();
    /// Lets the program publish or ask for something. What that throws passes through. No handler and no operation runs
    /// in it.
    template <class F>
    void let(F&& say) {
        if (asked_ || serving_) {
            std::forward<F>(say)();
            return;
        }
        try {
            say_alone(std::forward<F>(say));
            write_what_is_alone();
        } catch (...) {
            ask_if_something_waits();
            throw;
        }
        ask_if_something_waits();
    }
    /// Writes the last. From now on there are no more turns.
    void stop();

    /// While it stands, a handler runs. Not to be kept while that waits: there is one for the whole node.
    class serving {
      public:
        explicit serving(turns& of) noexcept : of_(of), before_(std::exchange(of.serving_, true)) {}
        serving(const serving&) = delete;
        serving& operator=(const serving&) = delete;
        ~serving() { of_.serving_ = before_; }

      private:
        turns& of_;
        bool before_;
    };

  private:
    /// While it stands no turn is posted: its owner sees to what waits.
    class posts_none {
      public:
        explicit posts_none(turns& of) noexcept : of_(of), before_(std::exchange(of.asked_, true)) {}
        posts_none(const posts_none&) = delete;
        posts_none& operator=(const posts_none&) = delete;
        ~posts_none() { of_.asked_ = before_; }

      private:
        turns& of_;
        bool before_;
    };
    /// Those that wait, but what begins to wait meanwhile. Who has not been told `done` waits on when it ends.
    class round;

    template <class F>
    void say_alone(F&& say) {
        const posts_none during{*this};
        std::forward<F>(say)();
    }
    void carry_on();
    void write_what_is_alone();
    /// Puts what has been published to its binders. How much it was in all; none: nothing, or it waits for more.
    std::optional<std::uint64_t> publish(bool alone);
    void ask_if_something_waits();

    turn_host& host_;
    const clock& time_;
    update_gathering gathering_;
    std::vector<std::shared_ptr<turn_taker>> waiting_;
    std::vector<std::shared_ptr<turn_taker>> spare_; // empty: room for the next
    bool asked_ = false;
    bool serving_ = false;
};

} // namespace cles::core
