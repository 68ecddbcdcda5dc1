// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>
#include <cles/convert_wrapped.hpp>
#include <cles/error.hpp>
#include <cles/feed_event.hpp>
#include <cles/responder.hpp>

#include <boost/system/error_code.hpp>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

/// Feeds of jobs: what `responder::bind` returns. Include this to call it.

namespace cles {

/// An event of a job's feed. Its texts are valid during the call that receives it.
struct job_event {
    feed_event kind = feed_event::update;
    std::string_view json = "{}"; ///< of `current` and `update`: an object or an array
    std::string_view publisher{}; ///< the publishing node's name; empty if not known
    /// Of `update`, and of `current` with `bind_options::mark`: its sequence number in the noun's publications; 0 if it
    /// is not known.
    std::uint64_t seq = 0;
    std::uint32_t epoch = 0;  ///< of what has a `seq`: that of the publisher's run, in which it counts
    std::uint64_t missed = 0; ///< of `gap`: updates that were not received
    std::string_view text{};  ///< why the publisher was lost, or why the feed has ended
    /// How long it has waited for a worker. Zero in an application.
    std::chrono::nanoseconds waited{0};

    /// Whether this kind of event has a value.
    [[nodiscard]] bool has_value() const noexcept { return kind == feed_event::current || kind == feed_event::update; }
    /// The value as a T; scalars are unwrapped from {"value":x}.
    /// \throws cles::error with `conversion`, naming the path to the part that does not fit
    template <class T>
    [[nodiscard]] T as() const {
        using carrier = std::conditional_t<detail::comes_wrapped<T>, detail::wrapped<T>, T>;
        carrier read{};
        std::string why;
        if (!cles::from_json(json, read, &why)) {
            throw error(errc::conversion, "the update is invalid: " + why);
        }
        if constexpr (detail::comes_wrapped<T>) {
            return std::move(read.value);
        } else {
            return read;
        }
    }
};

/// Receives the next event of a job's feed. If `code` is set, the feed has ended, for the reason in `event.text`.
using event_callback = std::function<void(boost::system::error_code code, const job_event& event)>;

namespace detail {

/// The implementation of a job's feed: in the service, in the runtime's pool, and in a plugin.
class job_feed_control {
  public:
    job_feed_control() = default;
    job_feed_control(const job_feed_control&) = delete;
    job_feed_control& operator=(const job_feed_control&) = delete;
    virtual ~job_feed_control() = default;
    virtual void next(event_callback taken) = 0;
    virtual void close() noexcept = 0;
};

} // namespace detail

/// A binding of a job to a noun of another node. Copies refer to the same binding; it ends with the job, with `close`,
/// or when the last copy is destroyed.
///
///     void follow(const cles::responder& job, const cles::job_feed& speeds) {
///         speeds.next([job, speeds](boost::system::error_code code, const cles::job_event& event) {
///             if (code) {
///                 job.done(); // the publisher denies it, or nobody waits for the job any more
///             } else {
///                 drive_at(event.as<double>());
///                 follow(job, speeds);
///             }
///         });
///     }
///
/// Nothing is delivered that has not been asked for, so the job sets the pace and holds no thread while it waits. What
/// comes meanwhile waits at the node: at most `bind_options::keep` updates (64 without it), and the bytes of
/// `limits::binding_bytes`. Beyond that, the oldest are dropped, and a gap tells how many. When the publisher is lost,
/// the feed reports it and binds again by itself, as `feed` does.
///
/// As a responder, it may be used on any thread in a plugin, and on the service's executor in an application.
class job_feed {
  public:
    job_feed() = default;
    /// Takes over a binding, which is closed with the last copy of this.
    explicit job_feed(std::shared_ptr<detail::job_feed_control> control);

    /// Calls back exactly once, never inside this call: with the next event, or with the reason why there is none. That
    /// is the publisher's if it refuses the binding; `cancelled` after `close` and the end of the job; `busy` if the
    /// last call has not been answered. In a plugin, the callback is a part of the job, and runs on a worker, after the
    /// handler and all earlier callbacks of the job have returned.
    /// \throws cles::error with `closed` if it is the feed of no job
    void next(event_callback taken) const;
    /// Unbinds. A call of `next` that has not been answered fails with `cancelled`.
    void close() const noexcept;
    /// Whether it is the feed of a job.
    [[nodiscard]] bool is_open() const noexcept { return control_ != nullptr; }

  private:
    std::shared_ptr<detail::job_feed_control> control_;
};

} // namespace cles
