// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>
#include <cles/update_mark.hpp>

#include "core/counters.hpp"
#include "core/deadlines.hpp"
#include "core/memory_budget.hpp"
#include "core/update_log.hpp"

#include <boost/intrusive/list.hpp>

#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// The end of a link that updates are put to.
class binder {
  public:
    binder() = default;
    binder(const binder&) = delete;
    binder& operator=(const binder&) = delete;
    /// Whether it takes more just now; if not, it asks for the rest when it does.
    [[nodiscard]] virtual bool takes_updates() const = 0;
    virtual void put_updates(std::string_view lines) = 0;

  protected:
    ~binder() = default;
};

class topic;

/// One binder's place in a topic.
class binding final : public deadline {
  public:
    struct terms {
        std::chrono::milliseconds every{0};
        std::uint32_t keep = 64;

        bool operator==(const terms&) const = default;
    };

    binding(topic& source, binder& target, terms wanted) : source_(source), target_(target), terms_(wanted) {}

    /// Puts what waits to the binder, as far as it takes it.
    void drain(time_point now);
    void set_terms(terms wanted) noexcept { terms_ = wanted; }
    [[nodiscard]] binder& target() const noexcept { return target_; }
    /// There are updates that it has not been given.
    [[nodiscard]] bool is_behind() const noexcept;

  private:
    friend topic;
    void on_deadline(time_point now) override;
    void drain_newest(time_point now);
    void drain_all();

    topic& source_;
    binder& target_;
    terms terms_;
    std::uint64_t seen_ = 0; // the last update that it was given, or that was dropped for it
    time_point next_due_{};  // with `every`: not before
};

/// What a topic shares with the others of its node.
struct topic_context {
    deadline_queue& deadlines;
    counters& counts;
    std::size_t binding_bytes;
    std::shared_ptr<memory_account> memory{}; ///< of what topics keep; null: nobody counts
};

struct task_nouns;

/// A noun that is published: its last updates, who is bound to it and how far each has got. In a list while nobody is
/// bound to it, so that those can be found that nobody needs.
class topic : public boost::intrusive::list_base_hook<boost::intrusive::link_mode<boost::intrusive::auto_unlink>> {
  public:
    /// Its first update is numbered one more than `last`.
    topic(topic_context shared, std::string path, std::uint64_t last = 0, task_nouns* of = nullptr)
        : task(of), shared_(std::move(shared)), path_(std::move(path)), log_(last), held_(shared_.memory) {}

    task_nouns* const task; ///< among which it counts

    [[nodiscard]] const std::string& path() const noexcept { return path_; }
    [[nodiscard]] std::uint64_t seq() const noexcept { return log_.last(); }
    /// Something has been published and not retired.
    [[nodiscard]] bool has_value() const noexcept { return has_value_; }
    /// The body of the last update; empty where there is none.
    [[nodiscard]] std::string_view last_body() const noexcept;

    /// Which update that is; nothing where there is none.
    [[nodiscard]] std::optional<update_mark> last_mark() const;

    /// The last update with its LF; empty where there is none.
    [[nodiscard]] std::string_view last_line() const noexcept;

    /// Begins the next update: append the line to what is returned, then `commit` (saying where in the line the body
    /// begins) or `roll_back`.
    std::string& begin() {
        begun_ = true;
        return log_.begin();
    }
    [[nodiscard]] bool is_begun() const noexcept { return begun_; }
    [[nodiscard]] std::string_view pending() const noexcept { return log_.pending(); }
    /// Ends the line and makes it the last update.
    void commit(std::size_t body_at);
    void roll_back();
    /// Takes note of the memory that its updates take, what was begun included. False where there is not as much.
    [[nodiscard]] bool hold() noexcept { return held_.try_resize(log_.memory()); }
    /// Forgets what waits for slow binders, but for the last update and what was begun.
    void shed();
    /// Forgets the last update, once every binder has it.
    void retire();

    binding& bind(binder& target, binding::terms wanted);
    /// False where it was not bound.
    bool unbind(binder& target);
    [[nodiscard]] binding* find(const binder& target) noexcept;
    [[nodiscard]] bool is_bound() const noexcept { return !bindings_.empty(); }

    /// Puts what waits to all binders that take it, and lets those publish that waited for room.
    void drain(time_point now);
    /// Takes note of how far the bindings have got, after one was drained by itself.
    void refresh() noexcept;
    /// Whether one more update fits the queue of every binder.
    [[nodiscard]] bool has_room() const noexcept;

    struct waiter {
        std::string body;
        detail::pending_ptr operation;
        std::uint64_t ticket = 0; ///< to withdraw it by
    };
    /// Updates that are to be published when there is room, oldest first.
    std::deque<waiter>& waiters() noexcept { return waiters_; }

  private:
    friend binding;
    void forget_retired() noexcept;

    topic_context shared_;
    std::string path_;
    update_log log_;
    memory_reservation held_;
    bool begun_ = false;
    bool has_value_ = false;
    std::size_t last_body_at_ = 0;
    std::vector<std::unique_ptr<binding>> bindings_;
    std::deque<waiter> waiters_;
    std::uint64_t slowest_ = 0;    // the least `seen_` of all bindings that take every update
    std::uint64_t room_until_ = 0; // the last number that fits every such binding's `keep`
    std::uint32_t longest_keep_ = 0;
    bool unthinned_ = false; // there are such bindings
};

} // namespace cles::core
