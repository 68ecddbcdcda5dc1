// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>
#include <cles/limits.hpp>

#include "node/base/completion_queue.hpp"
#include "node/base/string_map.hpp"
#include "node/publish/topic.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

class group_bindings;
class node_security;
class task_registry;

/// The topics with updates that have not been sent to their subscribers. `flush_scheduler` sends them.
class unsent_topics {
  public:
    /// `wake` is called for the first topic after each `take`.
    explicit unsent_topics(std::function<void()> wake) : wake_(std::move(wake)) {}
    unsent_topics(const unsent_topics&) = delete;
    unsent_topics& operator=(const unsent_topics&) = delete;

    /// The topic has a new update. Does nothing if nobody is bound to it.
    void mark(topic& t) {
        if (!t.is_bound()) {
            return;
        }
        ++updates_;
        if (std::find(topics_.begin(), topics_.end(), &t) == topics_.end()) {
            topics_.push_back(&t);
            if (topics_.size() == 1) {
                wake_();
            }
        }
    }
    /// The topic is to be destroyed.
    void forget(topic& t) { std::erase(topics_, &t); }
    [[nodiscard]] bool empty() const noexcept { return topics_.empty(); }
    /// The number of updates so far, including those that have been sent.
    [[nodiscard]] std::uint64_t updates() const noexcept { return updates_; }

    /// Removes and returns all topics. Give the list to `reuse` afterwards, for its capacity.
    [[nodiscard]] std::vector<topic*> take() noexcept { return std::exchange(topics_, std::exchange(spare_, {})); }
    void reuse(std::vector<topic*> list) noexcept {
        list.clear();
        spare_ = std::move(list);
    }

  private:
    std::function<void()> wake_;
    std::vector<topic*> topics_;
    std::vector<topic*> spare_; // empty
    std::uint64_t updates_ = 0;
};

/// The nouns of one task.
struct task_nouns {
    using idle_list = boost::intrusive::list<topic, boost::intrusive::constant_time_size<false>>;

    std::size_t count = 0;
    bool published = false; ///< at least one of them has been published
    idle_list idle{};       ///< had no subscriber when last used; least recently used first
};

/// Everything that a node publishes. When a task has reached its limit on nouns or memory, new nouns replace those that
/// nobody is bound to, least recently used first.
class publications final : public topic_source {
  public:
    /// Updates of tasks that are `registered` as signed are; without `security`, they are refused with `denied`. What
    /// these refer to must outlive this.
    [[gnu::cold]] publications(topic_context shared, const cles::limits& bounds, completion_queue& completions,
                               std::string publisher, std::string epoch, unsent_topics& unsent,
                               const task_registry* registered = nullptr, const node_security* security = nullptr);

    /// Publishes what `write` writes (a body, or a scalar, which is wrapped). The path is canonical.
    /// \throws cles::error: `too_large`, `busy`, `failed`, `denied`; what `write` throws. Then nothing is published,
    /// but nouns may have retired.
    void publish(std::string_view path, const std::function<void(json_writer&)>& write);
    /// Publishes JSON that is known to be valid and compact.
    void publish_body(std::string_view path, std::string_view body);
    /// Publishes any body now, or once every subscriber has capacity. Takes the operation, which completes through the
    /// completion queue. Returns true if published now. \throws as `publish`; then the operation is not taken
    bool publish_or_wait(std::string_view path, std::string_view body, detail::pending_ptr& operation,
                         std::uint64_t ticket = 0);
    /// Cancels an update that waits: it is not published, and its operation fails with `cancelled`. False if
    /// none with this ticket waits.
    [[gnu::cold]] bool cancel(std::uint64_t ticket);

    /// Notifies it of each new topic, before anything is published there. It must live until it is removed.
    void watch(group_bindings& who) { watching_.push_back(&who); }
    /// Does nothing if it is not registered.
    void unwatch(group_bindings& who) { std::erase(watching_, &who); }

    /// The topic, or null.
    [[nodiscard]] topic* find(std::string_view path) noexcept override;
    /// Whether anything of the task has been published or bound.
    [[nodiscard, gnu::cold]] bool knows(std::string_view task) const noexcept;
    /// The topic, for a BIND; created if necessary. No other retires for it, since anyone may bind anything. \throws
    /// cles::error with `busy` if the task has too many nouns
    [[gnu::cold]] topic& open(std::string_view path);
    /// Whether `open` finds or can create it.
    [[nodiscard, gnu::cold]] bool can_open(std::string_view path) noexcept;
    /// Whether it can be published, as far as the limit on nouns goes.
    [[nodiscard]] bool can_publish(std::string_view path) noexcept;
    /// Forgets the last value, and the noun too if nobody is bound to it. False if there is no value.
    bool retire(std::string_view path);
    /// The same for all nouns of a task. Returns how many there were.
    [[gnu::cold]] std::size_t retire_all(std::string_view task);
    /// Removes a topic without subscribers, waiters and value; one with a value becomes idle.
    void remove_if_unused(topic& t);
    /// A subscriber has gone: publishers that waited for it continue.
    void release(topic& t) override {
        admit(t);
        remove_if_unused(t);
    }

    /// Publishes the updates that wait for capacity in this topic, as far as there is some.
    void admit(topic& t) override;

    /// Removes and returns the operations of all updates that wait for capacity.
    [[nodiscard, gnu::cold]] std::vector<detail::pending_ptr> take_waiters();

    /// The names of the tasks that have been published.
    [[nodiscard, gnu::cold]] std::set<std::string> tasks() const;
    /// The nouns that have a value, as canonical paths.
    [[nodiscard, gnu::cold]] std::set<std::string> paths() const;

  private:
    [[gnu::cold]] topic& open(std::string_view path, bool to_publish);
    [[nodiscard]] static topic* oldest_idle(task_nouns& of) noexcept;
    void retire(topic& t);
    [[gnu::cold]] void remove(topic& t);
    static void mark_used(topic& t) noexcept;
    [[gnu::cold]] void take_memory(topic& t);
    /// What slow subscribers have not taken is kept, whatever memory it needs.
    void publish_lossless(std::string_view path, std::string_view body);
    void end(topic& t, std::size_t body_at);
    [[nodiscard]] bool must_sign(std::string_view path) const;
    /// Inserts the signature before the body, and returns where the body is then.
    [[nodiscard]] std::size_t sign(const topic& t, std::string& line, std::size_t body) const;

    topic_context shared_;
    const cles::limits& bounds_;
    completion_queue& completions_;
    std::string publisher_;
    std::string epoch_;
    unsent_topics& unsent_;
    std::vector<group_bindings*> watching_;
    string_map<std::unique_ptr<task_nouns>> nouns_; // per task
    string_map<std::unique_ptr<topic>> topics_;
    std::uint64_t highest_retired_ = 0; // the highest `seq` of all nouns that were removed
    bool lossless_ = false;
    const task_registry* registered_;
    const node_security* security_;
    topic* recent_ = nullptr; // usually the same noun is published again
};

} // namespace cles::core
