// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/limits.hpp>
#include <cles/pending.hpp>
#include <cles/update_mark.hpp>

#include "node/base/backoff.hpp"
#include "node/base/deadlines.hpp"
#include "node/publish/feed_mailbox.hpp"
#include "node/publish/subscription.hpp"
#include "protocol/request_line.hpp"

#include <boost/intrusive/list.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

class connection;
class feed_machine;

/// What a feed is bound to, and how.
struct feed_terms {
    std::string noun;
    std::string at;
    std::string at_node{}; ///< the only node that may answer at `at`; empty: any
    std::chrono::milliseconds deadline{};
    std::uint32_t every_ms = 0;
    std::uint32_t keep = 0;
    std::uint32_t hops = protocol::default_hops;
    std::string adverbs{};   ///< further ones, in wire format
    bool marked = false;     ///< requests the mark of the last value, if the publisher supports it
    bool shows_mark = false; ///< the same, for the reader of the events: the value is not delivered as an update too
    std::string via{};       ///< nodes that have forwarded it
    std::string requester{}; ///< the member for which this node binds it, if it is another one
};

/// What `feed_links` keeps for each feed.
struct feed_entry {
    std::weak_ptr<void> handle{}; ///< owns the feed
    feed_terms terms{};
    std::weak_ptr<connection> on{};
    std::string at{};                ///< the URL used last
    std::uint64_t asking = 0;        ///< the id of its last BIND by datagram
    std::optional<time_point> due{}; ///< the deadline of a BIND that waits for what it needs to know first
    /// The publisher denies what it has permitted before; with its reason. Does not destroy the feed.
    std::function<void(const std::string& why)> on_denied{};
};

/// What a feed needs of the service.
class feed_host {
  public:
    feed_host() = default;
    feed_host(const feed_host&) = delete;
    feed_host& operator=(const feed_host&) = delete;
    /// Sends a BIND; `on_bound` or `on_refused` follows, and later `on_lost` if its link is lost.
    virtual void bind(feed_machine& feed) = 0;
    /// Removes it from its link, and unbinds at the publisher.
    virtual void unbind(feed_machine& feed) = 0;
    /// Removes it from its link without notifying the publisher.
    virtual void detach(feed_machine& feed) = 0;
    /// Sends the BIND of a leased binding again; `on_renewed` or `on_renewal_refused` follows, the latter with
    /// `deadline` if there is no reply by `until`.
    virtual void renew(feed_machine& feed, time_point until) = 0;

  protected:
    ~feed_host() = default;
};

/// A feed's state machine: it binds, renews the lease of a binding by datagram, delivers events, and when the publisher
/// is lost binds again after a pause. Linked into the list of `feed_links` until it is closed.
class feed_machine final
    : public subscription,
      public boost::intrusive::list_base_hook<boost::intrusive::link_mode<boost::intrusive::auto_unlink>>,
      private deadline {
  public:
    using event_ptr = feed_mailbox::event_ptr;

    feed_machine(feed_host& host, deadline_queue& deadlines, completion_queue& completions, const limits& bounds,
                 std::string target, std::string path, bool thinned, std::uint32_t seed);
    ~feed_machine() = default;

    /// Binds for the first time. The operation completes with the reply, or fails at `due`, whatever it waits for then;
    /// if it fails, the feed is closed.
    void start(detail::pending_ptr bound, time_point due = time_point::max());
    /// `as_update`: the update that holds the last value, if the publisher says so. If it is new, it is delivered as an
    /// update too. `mark`: the same, which is only told with the value.
    void on_bound(std::string_view last, const std::optional<update_mark>& as_update = {},
                  const update_mark& mark = {});
    /// Bound by datagram, with a lease of `limits::lease`. It counts from the time the BIND was sent, not from the
    /// reply, so that it never ends at the publisher before it does here. It is renewed after a third of it, or a
    /// little earlier at random, so that many renewals do not coincide.
    void on_leased(time_point sent_at);
    void on_renewed(time_point sent_at);
    void on_renewal_refused(time_point sent_at, boost::system::error_code why, std::string_view message,
                            time_point now);
    /// `answer`: the failure as the publisher wrote it; empty: it did not.
    void on_refused(boost::system::error_code why, std::string_view message, time_point now,
                    std::string_view answer = {});
    /// Whether the publisher has bound it again in spite of this error: only its last value does not fit into the
    /// reply. Then call `on_bound` without that value.
    [[nodiscard]] bool is_bound_without_value(boost::system::error_code why) const noexcept {
        return state_ == state::binding && was_bound_ && why == errc::too_large;
    }
    void on_lost(std::string_view why, time_point now);

    /// The publisher may be reachable again: ends a pause.
    void expedite(time_point now);

    [[nodiscard]] feed_entry& entry() noexcept { return entry_; }
    [[nodiscard]] const feed_entry& entry() const noexcept { return entry_; }
    /// Its events, until they are fetched.
    [[nodiscard]] feed_mailbox& mail() noexcept { return mail_; }
    /// Closes the feed: the operations that wait for it fail.
    void close(errc why);
    [[nodiscard]] bool closed() const noexcept { return state_ == state::closed; }
    [[nodiscard]] bool is_bound() const noexcept override { return state_ == state::bound; }
    /// Whether it is bound, or was.
    [[nodiscard]] bool was_bound() const noexcept { return was_bound_; }
    /// Whether the operation of the first BIND is pending.
    [[nodiscard]] bool is_starting() const noexcept { return first_ != nullptr; }

  private:
    /// For how long a binding lives until pauses begin anew: a publisher that replies and closes the link each time is
    /// not asked ten times a second.
    static constexpr std::chrono::seconds proven{5};

    enum class state : std::uint8_t { fresh, binding, bound, pausing, closed };

    bool on_event(const detail::raw_event& event, feed_mailbox::hand_over when) override {
        return mail_.put(event, when);
    }
    void on_deadline(time_point now) override;
    void begin_lease(time_point sent_at);
    bool renew_later(time_point now);
    void pause(time_point now);
    void take_marked(const std::string& body, const update_mark& mark);

    feed_host& host_;
    feed_entry entry_;
    deadline_queue& deadlines_;
    std::size_t max_line_; // limits::line
    completion_queue& completions_;
    feed_mailbox mail_;
    backoff backoff_;
    jitter jitter_;                   // of renewals
    std::chrono::milliseconds lease_; // limits::lease
    time_point lease_end_{};
    time_point bind_sent_at_{}; // after a pause; the first binding counts as proven
    time_point bound_at_{};     // when the BIND was sent from which leases count
    state state_ = state::fresh;
    bool was_bound_ = false;
    detail::pending_ptr first_;
};

} // namespace cles::core
