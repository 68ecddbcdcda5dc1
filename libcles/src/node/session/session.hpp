// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/peer_reply.hpp"
#include "node/publish/subscription.hpp"
#include "node/security_protocol.hpp"
#include "node/session/inbound.hpp"
#include "node/session/outbound.hpp"

#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// The protocol on one link, whatever its transport: requests and replies in both directions. Lines and time are the
/// input; the output goes to the line sink.
class session {
  public:
    [[gnu::cold]] session(std::shared_ptr<node_state> host, line_sink& out, subscriber& updates, const identity& peer);

    void on_line(std::string_view line, time_point now);
    [[gnu::cold]] void on_overlong(std::string_view head);
    /// The peer has ended in the middle of this line.
    [[gnu::cold]] void on_cut(std::string_view rest);
    /// The peer sends no more.
    [[gnu::cold]] void on_end();
    /// The link is gone; `why` is the reason.
    [[gnu::cold]] void on_lost(std::string_view why);

    /// Whether no state is kept for the peer, and no reply or update is expected from it.
    [[nodiscard]] bool is_idle() const noexcept {
        return inbound_.is_idle() && outbound_.in_flight() == 0 && subscriptions_.empty();
    }
    /// Sends the last line of this node, which leaves, and ends the link. Everything that it started for the peer has
    /// been answered. Does nothing over datagrams.
    [[gnu::cold]] void send_leave_notice();
    /// States the version of this node's roster.
    [[gnu::cold]] void send_hello();
    /// Asks a publisher, whose updates the peer passes on, for its epoch (`link_security::ask`). \pre the node is
    /// secured
    [[gnu::cold]] void ask_publisher(const std::string& publisher, time_point due, peer_reply::function then) {
        secured_->ask(publisher, due, std::move(then));
    }
    /// Answers a line with `busy`, and does nothing else.
    [[gnu::cold]] void reject(std::string_view line);
    [[nodiscard]] inbound& serving() noexcept { return inbound_; }
    [[nodiscard]] outbound& asking() noexcept { return outbound_; }
    [[nodiscard]] const outbound& asking() const noexcept { return outbound_; }
    [[nodiscard]] subscriptions& bound() noexcept { return subscriptions_; }
    /// This node opened the link: the peer may refuse it as a whole, with a `busy` that answers no request.
    void expect_refusal() noexcept { may_be_refused_ = true; }

  private:
    [[gnu::cold]] void refuse(std::string_view text, const char* why);
    void on_reply(std::string_view line);
    /// Counts and logs a reply that has no effect. \param why it is malformed; empty: nobody waits for it
    [[gnu::cold]] void drop_reply(std::string_view why);
    [[gnu::cold]] void drop_update(const subscriptions::match& found);
    [[gnu::cold]] void note_refusal(std::string_view line);
    [[gnu::cold]] void lose_requests(std::string_view why);
    [[gnu::cold]] void on_leaving();
    void on_update(const subscriptions::match& found);

    std::shared_ptr<node_state> node_;
    line_sink& out_;
    const identity& peer_;
    inbound inbound_;
    outbound outbound_;
    subscriptions subscriptions_;
    std::unique_ptr<link_security> secured_; // null: the node is not secured
    bool may_be_refused_ = false;            // by the first line
    std::string refusal_;                    // the line that refused the link, if it remains the only one
    bool closed_ = false;
};

} // namespace cles::core
