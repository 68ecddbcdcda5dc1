// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>
#include <cles/update_mark.hpp>

#include "node/publish/feed_machine.hpp"
#include "node/session/connection.hpp"

#include <boost/intrusive/list.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

class local_node;

/// The feeds of a service and their links: finds a link for each feed, sends its BIND, and unbinds it.
class feed_links final : public feed_host {
  public:
    explicit feed_links(local_node& host) noexcept : host_(host) {}

    /// Call once, before the feed starts. It is in the list until it is closed.
    void enter(feed_machine& feed, std::weak_ptr<void> handle, feed_terms terms);
    void bind(feed_machine& feed) override;
    void unbind(feed_machine& feed) override;
    void detach(feed_machine& feed) override;
    void renew(feed_machine& feed, time_point until) override;
    /// The node has a new incarnation: feeds that wait to bind there do so at once. `replaced`: feeds that are still
    /// bound to the previous incarnation are bound again.
    void on_new_incarnation(std::string_view node, bool replaced);
    /// Updates of the node no longer arrive by the link to `address`: feeds of it bind by another.
    void on_route_lost(std::string_view node, std::string_view address);
    /// The roster or the rules have changed: ends the bindings that are no longer permitted.
    void on_security_changed();
    /// Closes all feeds.
    void stop();

  private:
    /// To a request for a feed.
    struct reply {
        boost::system::error_code code{}; ///< why it failed
        std::string_view text;            ///< the body, or the message of the failure
        std::optional<update_mark> mark{};
        std::string_view answer{}; ///< the failure as the peer wrote it, if it did
    };
    /// Calls `act` for the feeds that it concerns, and still does when it is their turn: a completion may close others.
    template <class Condition, class Action>
    void for_each(Condition concerns, Action act);
    /// Unbinds the bound feeds that it concerns, and reports why; they bind again after a pause, or at once.
    void unbind_where(const std::function<bool(feed_machine&)>& concerns, const std::string& why, bool bind_at_once);

    /// Null: the feed or its service has been destroyed.
    using reply_function = std::function<void(local_node* host, const reply&)>;
    class feed_reply;

    /// What the mark of the last value is used for, if it was requested.
    enum class marking : std::uint8_t {
        none,
        as_update, ///< the value is delivered as an update if it is new
        up_to_it,  ///< updates up to it are old: they were queued for a shared binding, or are in the value
    };

    [[nodiscard]] detail::pending_ptr on_reply(const feed_machine& feed, reply_function then);
    /// In a secured fleet: whether the node at the other end has not proved to be the publisher, and so may pass on
    /// what that one has published.
    [[nodiscard]] bool is_passed_on(const feed_machine& feed, const connection& c) const;
    [[nodiscard]] bool is_value_trusted(feed_machine& feed) const;
    /// `asked`: when the BIND was sent by datagram; empty for a stream.
    void on_bind_reply(feed_machine& feed, const reply& received, std::optional<time_point> asked, marking marks);
    void send_bind(feed_machine& feed, const std::shared_ptr<connection>& c);
    void ask_for_description(feed_machine& feed, const std::shared_ptr<connection>& c);
    void ask_publisher(feed_machine& feed, const std::shared_ptr<connection>& c);
    void bind_on(feed_machine& feed, const std::shared_ptr<connection>& c);
    [[nodiscard]] static marking marking_of(feed_machine& feed, connection& c);
    [[nodiscard]] protocol::outgoing_request bind_request(feed_machine& feed, const connection& c);
    /// Whether the node may bind it. True without security.
    [[nodiscard]] bool is_permitted(feed_machine& feed) const;
    void refuse_later(feed_machine& feed, boost::system::error_code code, const std::string& why);

    local_node& host_;
    boost::intrusive::list<feed_machine, boost::intrusive::constant_time_size<false>> feeds_;
};

} // namespace cles::core
