// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/job_feed.hpp>
#include <cles/plugin_abi.h>
#include <cles/responder.hpp>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

namespace cles::runtime {

/// A callback of a plugin, whose copies call it once at most. The last copy drops it.
std::function<void()> plugin_callback(void (*call)(void*), void (*drop)(void*), void* user);

/// The open jobs of plugins, by their handles.
///
/// A plugin holds a number, never a pointer: if it answers a job twice, or one that does not exist, the number is
/// invalid, which is counted.
///
/// A plugin answers from any thread. The responder of a job on a pool of workers is used on that thread; it knows
/// itself whether it is stopped, and calls the `on_stop` callback. The responder of an inline job belongs to an
/// executor: while the task's `start` runs, its thread may use it; from other threads the use is posted, and `stop` has
/// to be called when the job is stopped. All functions may be called from any thread, except for `close`, which has to
/// be called on the executor of the responders.
class plugin_jobs {
  public:
    using id = std::uint64_t;

    static constexpr std::size_t max_open = 65536;

    /// A handle for a request whose `start` is about to be called on this thread. 0 if there are too many, or after
    /// `close`.
    id open(responder answer);
    /// `start` has returned.
    void started(id job);

    /// Ends a job and returns its responder, if this thread may use it. Nothing if it may not, or there is no such job.
    std::optional<responder> take_if_direct(id job);
    /// Ends a job: calls `answer` with its responder, once, now or soon. False if there is no such job.
    bool finish(id job, std::function<void(const responder&)> answer);
    /// Calls `use` with the responder of a job, now or soon. False if there is no such job.
    bool use(id job, std::function<void(const responder&)> use);
    /// The responder of a job, if any thread may use it. Nothing if it may not, or there is no such job.
    [[nodiscard]] std::optional<responder> find_shared(id job);
    /// Whether its requester does not wait for it any more.
    [[nodiscard]] bool stopped(id job);
    /// Calls back when the job is stopped; at once if it has been.
    void on_stop(id job, std::function<void()> callback);
    /// An inline job is stopped. Returns its `on_stop` callback, to be called on a thread where it may take long.
    [[nodiscard]] std::function<void()> stop(id job);

    /// Ends all jobs with `answer`, and accepts no more. Returns their `on_stop` callbacks, to be called on a thread
    /// where they may take long. Nothing is posted after it returns.
    std::vector<std::function<void()>> close(const std::function<void(const responder&)>& answer);

    [[nodiscard]] std::size_t size() const;
    /// How many answers were for jobs that do not exist (any more).
    [[nodiscard]] std::uint64_t unknown_answers() const;

  private:
    struct slot {
        std::uint32_t generation = 0;
        bool stopped = false;
        bool thread_safe = false; ///< any thread may use the responder
        std::thread::id starting_thread{};
        std::optional<responder> answer{};
        std::function<void()> on_stop{};
    };
    [[nodiscard]] slot* find(id job) noexcept;
    [[nodiscard]] static bool is_direct(const slot& s) noexcept {
        return s.thread_safe || s.starting_thread == std::this_thread::get_id();
    }
    /// Empties the slot. The returned contents have to be destroyed without the lock.
    slot release(id job);

    mutable std::mutex mutex_;
    std::vector<slot> slots_;
    std::vector<std::uint32_t> free_;
    std::size_t open_ = 0;
    std::uint64_t unknown_answers_ = 0;
    bool closed_ = false;
};

/// The time in which the plugin's code for a job runs on this thread: `start`, or a callback. What the job may only get
/// afterwards waits for the end of the turn.
class plugin_turn {
  public:
    /// Calls a function on another thread.
    using other_thread = std::function<void(std::function<void()>)>;
    /// A turn may prolong itself so often at its end; then a turn on another thread continues it, so that a job which
    /// asks again and again for what has ended keeps no worker.
    static constexpr int most_rounds = 64;

    explicit plugin_turn(plugin_jobs::id job) noexcept;
    plugin_turn(const plugin_turn&) = delete;
    plugin_turn& operator=(const plugin_turn&) = delete;
    /// Calls what waits, as parts of this turn.
    ~plugin_turn();

    /// The job of this thread's turn; 0: none.
    [[nodiscard]] static plugin_jobs::id current_job() noexcept;
    /// Calls it at the end of this thread's turn. \pre it has one
    static void call_at_end(std::function<void()> what, other_thread elsewhere);

  private:
    bool pass_on() noexcept;

    plugin_jobs::id job_;
    plugin_turn* outer_;
    std::vector<std::function<void()>> waiting_;
    other_thread elsewhere_;
};

/// Something that a plugin's job waits for. The plugin gets it exactly once, even if it never arrives, and never during
/// the call that begins the wait.
class plugin_wait {
  public:
    /// Calls a function later: as a part of the job, or on another thread.
    using deferred_call = std::function<void(std::function<void()>)>;

    plugin_wait(const plugin_wait&) = delete;
    plugin_wait& operator=(const plugin_wait&) = delete;

    /// The call that begins the wait is about to return: from now on this thread may deliver the result.
    void sent() noexcept { sending_thread_ = std::thread::id{}; }

  protected:
    plugin_wait(plugin_jobs::id job, deferred_call call_later)
        : job_(job), call_later_(std::move(call_later)), sending_thread_(std::this_thread::get_id()) {}
    ~plugin_wait() = default;

    /// Whether this is the first result.
    [[nodiscard]] bool claim() noexcept { return !claimed_.exchange(true); }
    [[nodiscard]] bool is_claimed() const noexcept { return claimed_; }
    /// Whether this thread is in the call that begins the wait, so that it must not deliver the result.
    [[nodiscard]] bool is_sending() const noexcept { return sending_thread_.load() == std::this_thread::get_id(); }
    void defer(std::function<void()> deliver) const { call_later_(std::move(deliver)); }
    /// That waits; 0: it has ended, or never existed.
    [[nodiscard]] plugin_jobs::id job() const noexcept { return job_; }

  private:
    const plugin_jobs::id job_;
    deferred_call call_later_;
    std::atomic<std::thread::id> sending_thread_;
    std::atomic<bool> claimed_{false};
};

/// A request that a plugin's job has sent.
class plugin_request final : public plugin_wait {
  public:
    plugin_request(const cles_ask& ask, plugin_jobs::id job, deferred_call call_later)
        : plugin_wait(job, std::move(call_later)), answered_(ask.answered), progress_(ask.progress), user_(ask.user) {}
    ~plugin_request();

    void complete(boost::system::error_code code, std::string_view json, std::string_view message) noexcept;
    void report_progress(double fraction, std::string_view json) noexcept;

  private:
    decltype(cles_ask::answered) answered_;
    decltype(cles_ask::progress) progress_;
    void* user_;
};

/// The next event of a feed, for which a plugin's job has asked.
class plugin_next final : public plugin_wait {
  public:
    plugin_next(const cles_next& next, plugin_jobs::id job, deferred_call call_later)
        : plugin_wait(job, std::move(call_later)), event_(next.event), user_(next.user) {}
    ~plugin_next();

    /// \param what if `code` is set, the reason is its text
    void complete(boost::system::error_code code, const job_event& what) noexcept;

  private:
    decltype(cles_next::event) event_;
    void* user_;
};

} // namespace cles::runtime
