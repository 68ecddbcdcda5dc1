// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>
#include <cles/update_mark.hpp>

#include "node/base/deadlines.hpp"
#include "node/base/memory_budget.hpp"
#include "node/base/metrics.hpp"
#include "node/publish/binding.hpp"

#include <boost/intrusive/list.hpp>

#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

/// The last updates of a noun, as the lines sent to its subscribers, in one contiguous buffer.
///
/// Each subscriber has a position in it instead of its own queue: publishing costs the same for any number of them, and
/// what a subscriber has missed is sent as one piece. Lines are numbered from 1, like `seq`.
class update_log {
  public:
    /// The first line has the number `last` + 1.
    explicit update_log(std::uint64_t last = 0) noexcept : first_(last + 1) {}

    /// Starts a line: append it to the string, without its LF, then call `commit` or `roll_back`.
    std::string& begin() noexcept { return text_; }
    void commit();
    [[gnu::cold]] void roll_back();
    /// The line being written, so far.
    [[nodiscard]] std::string_view pending() const noexcept;

    /// The number of the newest line; at first, the constructor's `last`.
    [[nodiscard]] std::uint64_t last() const noexcept { return first_ + sizes() - 1; }
    /// The number of the oldest line kept.
    [[nodiscard]] std::uint64_t first() const noexcept { return first_; }
    /// The lines from `from` to `to`, both included and kept, as one text.
    [[nodiscard]] std::string_view lines(std::uint64_t from, std::uint64_t to) const noexcept;
    [[nodiscard]] std::size_t bytes(std::uint64_t from, std::uint64_t to) const noexcept {
        return lines(from, to).size();
    }
    /// Forgets all lines before `from`, but never the newest.
    void forget_before(std::uint64_t from);
    /// Forgets all lines. The numbers continue.
    void clear() noexcept;
    /// Releases spare memory.
    void fit();
    [[nodiscard]] bool empty() const noexcept { return sizes() == 0; }
    /// Memory in bytes, the line being written and spare capacity included.
    [[nodiscard]] std::size_t memory() const noexcept {
        return text_.capacity() + ends_.capacity() * sizeof(std::size_t);
    }

  private:
    [[nodiscard]] std::uint64_t sizes() const noexcept { return ends_.size() - head_; }
    void compact();
    [[nodiscard]] std::size_t start_of(std::uint64_t number) const noexcept;

    std::string text_;
    std::vector<std::size_t> ends_; // where each line ends in `text_`
    std::size_t head_ = 0;          // the index of the oldest line kept
    std::uint64_t first_ = 1;
};

/// What the topics of a node share.
struct topic_context {
    deadline_queue& deadlines;
    counters& counts;
    std::size_t binding_bytes;
    std::shared_ptr<memory_account> memory{}; ///< for what topics keep; null: not counted
};

struct task_nouns;

/// A published noun: its last updates, its subscribers and their positions. Linked into a list while it has no
/// subscribers, so that topics that nobody needs can be found.
class topic : public boost::intrusive::list_base_hook<boost::intrusive::link_mode<boost::intrusive::auto_unlink>> {
  public:
    /// Its first update has the number `last` + 1.
    topic(topic_context shared, std::string path, std::uint64_t last = 0, task_nouns* of = nullptr)
        : task(of), shared_(std::move(shared)), path_(std::move(path)), log_(last), held_(shared_.memory) {}

    task_nouns* const task; ///< the task it belongs to

    [[nodiscard]] const std::string& path() const noexcept { return path_; }
    [[nodiscard]] std::uint64_t seq() const noexcept { return log_.last(); }
    /// Whether something has been published and not retired.
    [[nodiscard]] bool has_value() const noexcept { return has_value_; }
    /// The body of the last update; empty if there is none.
    [[nodiscard]] std::string_view last_body() const noexcept;

    /// The mark of the last update; nothing if there is none.
    [[nodiscard]] std::optional<update_mark> last_mark() const;

    /// The last update with its LF; empty if there is none.
    [[nodiscard]] std::string_view last_line() const noexcept;

    /// Starts the next update: append the line to the returned string, then call `commit` (with the position of the
    /// body in the line) or `roll_back`.
    std::string& begin() noexcept { return log_.begin(); }
    [[nodiscard]] bool is_begun() const noexcept { return !pending().empty(); }
    [[nodiscard]] std::string_view pending() const noexcept { return log_.pending(); }
    /// Completes the line, which becomes the last update.
    void commit(std::size_t body_at);
    [[gnu::cold]] void roll_back();
    /// Accounts for the memory of its updates, the one being written included. False if there is not enough.
    [[nodiscard]] bool account_memory() noexcept { return held_.try_resize(log_.memory()); }
    /// Drops what waits for slow subscribers, except the last update and the one being written.
    void shed();
    /// Forgets the last update, once every subscriber has it.
    void retire();

    /// Binds a subscriber, or changes the terms of its binding.
    [[gnu::cold]] void bind(subscriber& target, binding::terms wanted);
    /// Returns false if it was not bound.
    [[gnu::cold]] bool unbind(subscriber& target);
    [[nodiscard]] binding* find(const subscriber& target) noexcept;
    [[nodiscard]] bool is_bound() const noexcept { return !bindings_.empty(); }
    /// Sends all subscribers their pending updates, as far as they take them.
    void drain(time_point now);
    /// The publisher denies the noun.
    [[gnu::cold]] void tell_denied() const;
    /// Records the positions after a binding was drained on its own.
    void refresh() noexcept;
    /// Whether one more update fits into the queue of every subscriber.
    [[nodiscard]] bool has_capacity() const noexcept;

    struct waiter {
        std::string body;
        detail::pending_ptr operation;
        std::uint64_t ticket = 0; ///< for cancellation
    };
    /// Updates that wait for capacity, oldest first.
    std::list<waiter>& waiters() noexcept { return waiters_; }

  private:
    friend binding;
    void forget_retired() noexcept;
    [[nodiscard]] std::uint64_t first_needed() const noexcept;

    topic_context shared_;
    std::string path_;
    update_log log_;
    memory_reservation held_;
    bool has_value_ = false;
    bool unthinned_ = false; // some binding takes every update
    std::size_t last_body_at_ = 0;
    std::vector<std::unique_ptr<binding>> bindings_;
    // Of the bindings that take every update:
    std::uint64_t slowest_ = 0;    // the last update that each has been sent
    std::uint64_t fits_until_ = 0; // the last number that fits into each one's `keep`
    std::uint32_t max_keep_ = 0;
    std::list<waiter> waiters_;
};

} // namespace cles::core
