// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/plugin_abi.h>
#include <cles/plugin_text.hpp>
#include <cles/responder.hpp>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

namespace cles::runtime {

/// Something that a plugin wants to be called: once or never, and dropped in the end.
class plugin_callback {
  public:
    using function = void (*)(void*);

    plugin_callback() = default;
    plugin_callback(function call, function drop, void* user) noexcept : call_(call), drop_(drop), user_(user) {}
    plugin_callback(plugin_callback&& other) noexcept
        : call_(std::exchange(other.call_, nullptr)), drop_(std::exchange(other.drop_, nullptr)), user_(other.user_) {}
    plugin_callback& operator=(plugin_callback other) noexcept {
        std::swap(call_, other.call_);
        std::swap(drop_, other.drop_);
        std::swap(user_, other.user_);
        return *this;
    }
    ~plugin_callback();

    void operator()();

  private:
    function call_ = nullptr;
    function drop_ = nullptr;
    void* user_ = nullptr;
};

/// A callback that several may call, of whom the first does.
class shared_callback {
  public:
    shared_callback() = default;
    explicit shared_callback(plugin_callback what) : inside_(std::make_shared<inside>(std::move(what))) {}

    void operator()() const {
        if (inside_ && !inside_->called.exchange(true)) {
            inside_->what();
        }
    }
    [[nodiscard]] explicit operator bool() const noexcept { return inside_ != nullptr; }

  private:
    struct inside {
        explicit inside(plugin_callback w) : what(std::move(w)) {}
        plugin_callback what;
        std::atomic<bool> called{false};
    };
    std::shared_ptr<inside> inside_;
};

/// The jobs of plugins that have not been answered, by their handles.
///
/// What a plugin holds is a number, never a pointer: where it answers twice, or what never was, the number names
/// nothing, which is counted.
///
/// A plugin answers from any thread. The responder of a job on a pool of workers is used right there; it knows by
/// itself whether it is stopped, and has its callback called. That of a job in line belongs to an executor: while a
/// task's `start` runs, its own thread may use it, as its caller does; from elsewhere, what a plugin says is
/// posted, and the code that registers the job calls `stop`. All functions may be called from any thread, but for
/// `close`, which belongs on the executor of all the responders.
class plugin_jobs {
  public:
    using id = std::uint64_t;

    static constexpr std::size_t most = 65536;

    /// A handle for a request, whose `start` is about to be called in this thread. 0 where there are too many, or after
    /// `close`.
    id open(responder answer);
    /// `start` has returned.
    void started(id job);

    /// Ends a job where its responder may be used in this thread: the responder. Nothing where it may not, or where
    /// there is no such job.
    std::optional<responder> take_here(id job);
    /// Ends a job: `answer` is called with its responder, once, now or soon. False where there is no such job.
    bool finish(id job, std::function<void(const responder&)> answer);
    /// Uses the responder of a job, now or soon. False where there is no such job.
    bool use(id job, std::function<void(const responder&)> use);
    /// Whether nobody waits for it.
    [[nodiscard]] bool stopped(id job) const;
    /// Has it called when nobody waits any more; at once where that is so.
    void on_stop(id job, plugin_callback callback);
    /// Nobody waits any more for this job, which is one in line. What it wanted to be called then is returned: call it
    /// where it may take its time.
    [[nodiscard]] shared_callback stop(id job);

    /// Ends all jobs, by `answer`, and has no further ones. What the plugins wanted to be told then is returned: call
    /// it where it may take its time. After it, nothing is posted.
    std::vector<shared_callback> close(const std::function<void(const responder&)>& answer);

    [[nodiscard]] std::size_t size() const;
    /// How often a job was answered that was not there.
    [[nodiscard]] std::uint64_t unknown() const;

  private:
    struct slot {
        std::uint32_t generation = 0;
        bool stopped = false;
        bool anywhere = false; ///< any thread may use the responder
        std::thread::id starter{};
        std::optional<responder> answer{};
        shared_callback on_stop{};
    };
    [[nodiscard]] slot* find(id job) noexcept;
    [[nodiscard]] const slot* find(id job) const noexcept;
    [[nodiscard]] static bool is_direct(const slot& s) noexcept {
        return s.anywhere || s.starter == std::this_thread::get_id();
    }
    /// Empties the slot; what it held is to be destroyed without the lock.
    slot release(id job);

    mutable std::mutex mutex_;
    std::vector<slot> slots_;
    std::vector<std::uint32_t> free_;
    std::size_t open_ = 0;
    std::uint64_t unknown_ = 0;
    bool closed_ = false;
};

/// A request that a plugin's job has sent: the plugin is told the answer exactly once, even where it never comes, and
/// never from inside the call that asks.
class plugin_question {
  public:
    /// Has something called on another thread, soon.
    using elsewhere = std::function<void(std::function<void()>)>;

    plugin_question(const cles_ask& ask, elsewhere later)
        : answered_(ask.answered), progress_(ask.progress), user_(ask.user), later_(std::move(later)),
          asking_(std::this_thread::get_id()) {}
    plugin_question(const plugin_question&) = delete;
    plugin_question& operator=(const plugin_question&) = delete;
    ~plugin_question() { answer(errc::unavailable, "{}", "the node has stopped"); }

    /// The call that asks is about to return: from now on this thread may be told too.
    void asked() noexcept { asking_ = std::thread::id{}; }

    void answer(boost::system::error_code code, std::string_view json, std::string_view message) noexcept {
        if (over_.exchange(true) || answered_ == nullptr) {
            return;
        }
        const auto name = !code ? std::string_view{}
                                : wire_name(code.category() == error_category() ? static_cast<errc>(code.value())
                                                                                : errc::unavailable);
        const auto result = code ? std::string_view{"{}"} : json;
        try {
            if (asking_.load() == std::this_thread::get_id()) {
                later_([call = answered_, user = user_, name, result = std::string{result},
                        words = std::string{message}] { tell(call, user, name, result, words); });
                return;
            }
        } catch (...) { // no memory, no thread: better here than never
        }
        tell(answered_, user_, name, result, message);
    }

    void report(double fraction, std::string_view json) noexcept {
        if (progress_ != nullptr && !over_) {
            try {
                progress_(user_, fraction, detail::abi_text(json));
            } catch (...) { // as above
            }
        }
    }

  private:
    // \param name of the error; one of those in the table, which stays
    static void tell(decltype(cles_ask::answered) call, void* user, std::string_view name, std::string_view json,
                     std::string_view message) noexcept {
        try {
            call(user, detail::abi_text(name), detail::abi_text(json), detail::abi_text(message));
        } catch (...) { // a plugin's mistake is not ours
        }
    }

    decltype(cles_ask::answered) answered_;
    decltype(cles_ask::progress) progress_;
    void* user_;
    elsewhere later_;
    std::atomic<std::thread::id> asking_;
    std::atomic<bool> over_{false};
};

} // namespace cles::runtime
