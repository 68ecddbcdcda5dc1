// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>
#include <cles/limits.hpp>

#include "core/completion_queue.hpp"
#include "core/text_map.hpp"
#include "core/topic.hpp"
#include "core/topic_source.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

/// The nouns of one task.
struct task_nouns {
    using idle_list = boost::intrusive::list<topic, boost::intrusive::constant_time_size<false>>;

    std::size_t count = 0;
    bool published = false; ///< at least one of them has been
    idle_list idle{};       ///< nobody was bound to them when they were used last; the one used longest ago first
};

/// All that a node publishes. A task whose nouns are as many as they may be, or take as much memory, goes on with new
/// ones: those retire for them that nobody is bound to, the one that was used longest ago first.
class publications final : public topic_source {
  public:
    /// `wake` is called when there is something to drain, once until `drain`.
    publications(topic_context shared, const cles::limits& bounds, completion_queue& completions, std::string publisher,
                 std::string epoch, std::function<void()> wake);

    /// Publishes what `write` writes (a body, or a scalar that is wrapped). The path is canonical.
    /// \throws cles::error: `too_large`, `busy`, `failed`; what `write` throws. Nothing is published then, but nouns
    /// may have retired.
    void publish(std::string_view path, const std::function<void(json_writer&)>& write);
    /// Publishes JSON that is known to be valid and without white space.
    void publish_body(std::string_view path, std::string_view body);
    /// Publishes a body of any kind now, or once every binder has room, and takes the operation, which ends by the
    /// completion queue. True: now. \throws as `publish`; the operation is left then
    bool publish_when_room(std::string_view path, std::string_view body, detail::pending_ptr& operation,
                           std::uint64_t ticket = 0);
    /// Withdraws what waits for room: it is not published, and its operation fails with `cancelled`. False where
    /// nothing of that number waits.
    bool cancel(std::uint64_t ticket);

    /// Who is told of each topic that is made, before anything is published there.
    class observer {
      public:
        observer() = default;
        observer(const observer&) = delete;
        observer& operator=(const observer&) = delete;
        virtual void on_opened(topic& made) = 0;

      protected:
        ~observer() = default;
    };
    /// From now on; until it is removed it has to stay.
    void watch(observer& who) { observers_.push_back(&who); }
    /// Does nothing where it is not there.
    void unwatch(observer& who) { std::erase(observers_, &who); }

    /// The topic, or null.
    [[nodiscard]] topic* find(std::string_view path) noexcept override;
    /// Whether anything of the task has been published or bound.
    [[nodiscard]] bool knows(std::string_view task) const noexcept;
    /// The topic, to be bound to; made if need be. No other retires for it, since anybody may bind anything.
    /// \throws cles::error with `busy` where the task has too many nouns
    topic& open(std::string_view path);
    /// Whether `open` finds or makes it.
    [[nodiscard]] bool can_open(std::string_view path) noexcept;
    /// Whether it can be published, as far as the number of nouns goes.
    [[nodiscard]] bool can_publish(std::string_view path) noexcept;
    /// Forgets the last value, and the noun with it where nobody is bound. False where there is none.
    bool retire(std::string_view path);
    /// Forgets a topic that nobody is bound to and that was never published.
    void tidy(topic& t);
    /// Publishers that waited for this binder may go on.
    void release(topic& t) override {
        admit(t);
        tidy(t);
    }

    /// Puts to binders what has been published since the last time.
    void drain(time_point now);
    [[nodiscard]] bool dirty() const noexcept { return !dirty_.empty(); }
    /// Publishes what waits for room in this topic, as far as there is some.
    void admit(topic& t) override;

    /// How many updates there have been for somebody.
    [[nodiscard]] std::uint64_t published_to_binders() const noexcept { return to_binders_; }
    /// Takes out all that wait for room.
    [[nodiscard]] std::vector<detail::pending_ptr> take_waiters();

    /// The names of the tasks that have been published.
    [[nodiscard]] std::vector<std::string> tasks() const;

  private:
    topic& open(std::string_view path, bool to_publish);
    [[nodiscard]] static topic* oldest_idle(task_nouns& of) noexcept;
    void retire(topic& t);
    void remove(topic& t);
    static void use(topic& t) noexcept;
    void take_memory(topic& t);
    /// What slow binders have not taken stays, whatever it takes.
    void publish_lossless(std::string_view path, std::string_view body);
    void end(topic& t, std::size_t body_at);
    void mark(topic& t);

    topic_context shared_;
    const cles::limits& bounds_;
    completion_queue& completions_;
    std::string publisher_;
    std::string epoch_;
    std::function<void()> wake_;
    std::vector<observer*> observers_;
    text_map<std::unique_ptr<task_nouns>> nouns_; // per task
    text_map<std::unique_ptr<topic>> topics_;
    std::uint64_t highest_retired_ = 0; // the highest `seq` that is not remembered any more
    std::vector<topic*> dirty_;
    std::uint64_t to_binders_ = 0;
    bool lossless_ = false;
    topic* recent_ = nullptr; // most publish the same noun again
};

} // namespace cles::core
