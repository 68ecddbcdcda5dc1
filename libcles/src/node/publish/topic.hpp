// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>
#include <cles/update_mark.hpp>

#include "node/base/deadlines.hpp"
#include "node/base/memory_budget.hpp"
#include "node/base/metrics.hpp"
#include "node/publish/binding.hpp"
#include "node/publish/update_log.hpp"

#include <boost/intrusive/list.hpp>

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

class topic;

/// Where a link's peer finds what it binds: the topics that the node publishes, or those that it relays.
class topic_source {
  public:
    topic_source() = default;
    topic_source(const topic_source&) = delete;
    topic_source& operator=(const topic_source&) = delete;

    /// The topic, or null.
    [[nodiscard]] virtual topic* find(std::string_view path) noexcept = 0;
    /// A subscriber has gone; the topic may be removed.
    virtual void release(topic& t) = 0;
    /// A subscriber has taken its pending updates.
    virtual void admit(topic& t) = 0;

  protected:
    ~topic_source() = default;
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
    std::string& begin() {
        begun_ = true;
        return log_.begin();
    }
    [[nodiscard]] bool is_begun() const noexcept { return begun_; }
    [[nodiscard]] std::string_view pending() const noexcept { return log_.pending(); }
    /// Completes the line, which becomes the last update.
    void commit(std::size_t body_at);
    void roll_back();
    /// Accounts for the memory of its updates, the one being written included. False if there is not enough.
    [[nodiscard]] bool account_memory() noexcept { return held_.try_resize(log_.memory()); }
    /// Drops what waits for slow subscribers, except the last update and the one being written.
    void shed();
    /// Forgets the last update, once every subscriber has it.
    void retire();

    binding& bind(subscriber& target, binding::terms wanted) { return bindings_.bind(target, wanted); }
    /// Returns false if it was not bound.
    bool unbind(subscriber& target) { return bindings_.unbind(target); }
    [[nodiscard]] binding* find(const subscriber& target) noexcept { return bindings_.find(target); }
    [[nodiscard]] topic_bindings& bindings() noexcept { return bindings_; }
    [[nodiscard]] bool is_bound() const noexcept { return !bindings_.empty(); }
    /// Whether one more update fits into the queue of every subscriber.
    [[nodiscard]] bool has_room() const noexcept { return bindings_.has_room(); }

    struct waiter {
        std::string body;
        detail::pending_ptr operation;
        std::uint64_t ticket = 0; ///< for cancellation
    };
    /// Updates to publish when there is room, oldest first.
    std::deque<waiter>& waiters() noexcept { return waiters_; }

  private:
    friend binding;
    friend topic_bindings;
    void forget_retired() noexcept;

    topic_context shared_;
    std::string path_;
    update_log log_;
    memory_reservation held_;
    bool begun_ = false;
    bool has_value_ = false;
    std::size_t last_body_at_ = 0;
    topic_bindings bindings_{*this};
    std::deque<waiter> waiters_;
};

} // namespace cles::core
