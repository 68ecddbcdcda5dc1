// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>
#include <cles/pending.hpp>

#include "node/base/deadlines.hpp"
#include "node/base/memory_budget.hpp"
#include "node/session/connection.hpp"
#include "node/session/outbound.hpp"
#include "protocol/request_line.hpp"

#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {
class feed_machine;
} // namespace cles::core

namespace cles::core {

/// The channel to one URL: its links, opened when needed, and the requests that wait for one.
class peer_channel : public std::enable_shared_from_this<peer_channel> {
  public:
    peer_channel(std::shared_ptr<local_node> host, url where);
    /// To a node that is not discovered yet: holds its requests until `hand_over` or `fail`.
    peer_channel(std::shared_ptr<local_node> host, std::string_view node);

    /// Receives a link, or null with an error code and a message.
    using ready_function =
        std::function<void(const std::shared_ptr<connection>&, boost::system::error_code, std::string_view)>;
    /// Sends a request on an open link, or as soon as there is one; see `outbound::send`.
    void send(const protocol::outgoing_request& r, time_point deadline, time_point now, detail::pending_ptr operation,
              outbound::progress_function progress);
    /// Cancels a request that waits for its link. Returns false if there is none with that id.
    bool cancel(std::uint64_t id);
    /// Calls `ready` with a link on which the feed's noun is not bound yet; no longer after `forget`.
    void connect(core::feed_machine& feed, ready_function ready);
    void forget(const core::feed_machine& feed);
    /// Moves what waits here to another channel.
    void hand_over(peer_channel& channel);
    /// Fails what waits here, because there is no link.
    void fail(boost::system::error_code code, std::string_view message);
    /// `c` was lost or can no longer be used.
    void drop(const connection& c);
    /// Closes idle links.
    void release();
    /// Stops dialling, and fails the waiting requests, none inside the call.
    void stop();

    [[nodiscard]] const std::string& address() const noexcept { return address_; }
    /// Whether it can be removed without loss.
    [[nodiscard]] bool idle() const noexcept {
        return links_.empty() && requests_.empty() && waiting_feeds_.empty() && !give_up_;
    }

  private:
    /// A request that waits for a link, at most until its deadline.
    struct waiting final : core::deadline {
        waiting(peer_channel& channel, const protocol::outgoing_request& r)
            : owner(channel), request(copy_text(r, text)) {}
        void on_deadline(time_point now) override;

        peer_channel& owner;
        std::string text; // of the request
        protocol::outgoing_request request;
        detail::pending_ptr operation;
        core::memory_reservation memory;
        outbound::progress_function progress;
    };
    struct waiting_feed {
        core::feed_machine* feed;
        ready_function ready;
    };

    [[nodiscard]] std::shared_ptr<connection> usable() const;
    [[nodiscard]] std::shared_ptr<connection> free_for(const core::feed_machine& feed) const;
    void dial();
    void on_dialled(boost::system::error_code code, link_ptr made);
    void serve_waiting(const std::shared_ptr<connection>& c);

    std::shared_ptr<local_node> host_;
    std::optional<url> where_; // nothing: not known yet
    std::string address_;
    std::vector<std::shared_ptr<connection>> links_;
    std::list<std::unique_ptr<waiting>> requests_;
    std::list<waiting_feed> waiting_feeds_;
    std::function<void()> give_up_; // set while a link is being opened
};

} // namespace cles::core
