// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>
#include <cles/pending.hpp>

#include "node/base/deadlines.hpp"
#include "node/base/memory_budget.hpp"
#include "node/session/connection.hpp"
#include "node/session/outbound.hpp"
#include "protocol/request_line.hpp"

#include <boost/system/error_code.hpp>

#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

class feed_machine;
class local_node;

/// What limits the way of a request that this node forwards. Empty for its own ones.
struct forwarding {
    /// Nodes that have forwarded it: it does not lead through them.
    std::string_view via{};
    /// The member for which it is, if it is another one: nodes on the way may forward for it.
    std::string_view requester{};

    [[nodiscard]] bool empty() const noexcept { return via.empty() && requester.empty(); }
};

/// The channel to one URL: its links, opened when needed, and what waits for one.
class peer_channel : public std::enable_shared_from_this<peer_channel> {
  public:
    /// Without a URL, to a node that is not discovered yet: holds its requests until `hand_over` or `fail`.
    /// \param name of the node that must answer there; empty: any
    peer_channel(std::shared_ptr<local_node> host, std::string address, std::optional<url> where, std::string name)
        : host_(std::move(host)), address_(std::move(address)), where_(std::move(where)), name_(std::move(name)) {}

    /// Receives a link, or null with an error code and a message.
    using ready_function =
        std::function<void(const std::shared_ptr<connection>&, boost::system::error_code, std::string_view)>;
    /// How a request is sent.
    struct manner {
        bool anywhere = false;  ///< to the node that its noun names, wherever that is reached
        bool forwarded = false; ///< it is of a client
    };
    /// Sends a request on an open link, or as soon as there is one; see `outbound::send`.
    void send(const protocol::outgoing_request& r, time_point deadline, time_point now, detail::pending_ptr operation,
              outbound::progress_function progress, const manner& how);
    /// Cancels a request that waits for its link. Returns false if there is none with that id.
    bool cancel(std::uint64_t id);
    /// Calls `ready` with a link on which the feed's noun is not bound yet; no longer after `forget`.
    void connect(feed_machine& feed, ready_function ready);
    void forget(const feed_machine& feed);
    /// Moves what waits here to another channel.
    void hand_over(peer_channel& channel);
    /// Moves what waits here for a node, and not for this address, to the channel that `channel_to` returns for it.
    void reroute(const std::function<peer_channel*(std::string_view target, const forwarding& by)>& channel_to);
    /// Fails what waits here, because there is no link.
    void fail(boost::system::error_code code, std::string_view message);
    /// `c` was lost or can no longer be used.
    void drop(const connection& c);
    /// Closes idle links.
    void release();
    /// Stops dialling, and fails the waiting requests, none inside the call.
    void stop();

    [[nodiscard]] const std::string& address() const noexcept { return address_; }
    /// The node that was looked up by its name and is reached here; empty: only the address was given.
    [[nodiscard]] const std::string& node() const noexcept { return node_; }
    void set_node(std::string_view node) { node_ = node; }
    /// Whether a node that others announce, by this name, is at this address.
    [[nodiscard]] bool leads_to_known_node() const;
    /// Whether a link is being opened.
    [[nodiscard]] bool is_opening() const noexcept { return static_cast<bool>(give_up_); }
    /// Whether it can be removed without loss.
    [[nodiscard]] bool idle() const noexcept {
        return links_.empty() && requests_.empty() && feeds_.empty() && !give_up_;
    }

  private:
    /// A request that waits for a link, at most until its deadline.
    struct waiting_request final : deadline {
        waiting_request(peer_channel& channel, const protocol::outgoing_request& r)
            : owner(&channel), request(copy_text(r, text)) {}
        void on_deadline(time_point now) override;

        peer_channel* owner;
        std::string text; // of the request
        protocol::outgoing_request request;
        detail::pending_ptr operation;
        memory_reservation memory;
        outbound::progress_function progress;
        manner how;
    };
    struct waiting_feed {
        feed_machine* feed;
        ready_function ready;
    };
    using waiting_requests = std::list<std::unique_ptr<waiting_request>>;

    /// An open link, on which `feed` can be bound if it is not null.
    [[nodiscard]] std::shared_ptr<connection> usable_link(const feed_machine* feed = nullptr) const;
    void dial();
    void serve_or_dial();
    void on_dialled(boost::system::error_code code, link_ptr made);
    void serve_waiting(const std::shared_ptr<connection>& c);
    void fail(waiting_requests::iterator which, errc code, std::string_view message);

    std::shared_ptr<local_node> host_;
    std::string address_;      // its URL, or the node
    std::optional<url> where_; // nothing: not known yet
    std::string name_;         // of the node that must answer there, if any
    std::string node_;
    std::vector<std::shared_ptr<connection>> links_;
    waiting_requests requests_;
    std::list<waiting_feed> feeds_; // that wait for a link
    std::function<void()> give_up_; // set while a link is being opened
};

/// The channels of a service, and which of them leads to a node: first the configured URL, then a service on the same
/// context, then the address that the node itself announces.
class peer_channels {
  public:
    explicit peer_channels(local_node& host) noexcept : host_(host) {}

    /// Configures the URL of a node; an empty URL removes it. \throws cles::error
    void set_peer(std::string_view name, std::string_view where);
    /// Where requests are sent.
    struct destination {
        std::string_view target;
        std::string_view at{};       ///< empty: wherever the target is
        bool urgent = false;         ///< such requests have links of their own
        std::string_view expected{}; ///< the only node that may answer at `at`; empty: any
        forwarding by{};
        bool forwarded = false; ///< the request is of a client
    };
    /// The channel that leads there, or null with the reason in `code` and `why`. It may only hold requests for a node
    /// that is not discovered yet.
    peer_channel* to(const destination& where, boost::system::error_code& code, std::string& why);
    /// Sends a request there, by the urgent link if the request is urgent, and gives it an id. Without a channel that
    /// leads there, the operation fails later. Returns the id, or 0.
    std::uint64_t send(destination where, protocol::outgoing_request r, time_point deadline,
                       detail::pending_ptr operation, outbound::progress_function progress = {});
    /// Begins the span of a traced request that is about to be sent; returns the operation that ends it.
    [[nodiscard, gnu::cold]] detail::pending_ptr record(protocol::outgoing_request& r, std::string_view at,
                                                        const forwarding& by, detail::pending_ptr operation);
    /// The address of the node has become known, unknown, or another.
    void on_address_changed(std::string_view node);
    /// Requests for the node are sent elsewhere: moves those that wait for a link.
    void on_route_changed(std::string_view node);
    /// The nodes to which this one may have links have changed.
    void on_links_changed() noexcept { recent_ = nullptr; }
    /// A link has been opened to the channel's address, or could not be: then moves what can be sent by another route.
    void on_dialled(peer_channel& channel, boost::system::error_code code);
    /// Resolves or fails the names that wait for discovery.
    void on_discovery_grace_over();

    /// Tells who sends a request to that name, which only the first node of a name conflict gets, that there is a
    /// second one. `diagnostics`: where the requester wants to read it; null: nowhere.
    void tell_of_second(std::string_view target, std::string* diagnostics) const;

    /// Cancels a request that waits for its link. Returns false if there is none with that id.
    bool cancel(std::uint64_t id);
    /// The feed no longer waits for a link.
    void forget(const feed_machine& feed);
    /// Whether requests to the node go by datagram, which are too short for a roster.
    [[nodiscard]] bool is_by_datagram(std::string_view node) const;
    /// A URL by which the node may be reached over TLS: configured, announced, or the host and port at which it is
    /// configured for datagrams. Empty if there is none.
    [[nodiscard]] std::string tls_address_of(std::string_view node) const;

    /// `c` was lost or can no longer be used.
    void drop(const connection& c);
    /// No requests follow at that URL for a while: closes its idle links. `name`: of the only node that may answer.
    void release(std::string_view url, std::string_view name = {});
    /// Stops dialling, and fails the waiting requests.
    void stop();

  private:
    /// Where requests for a target are sent, and the node that answers there, which may be one on the way.
    struct place {
        std::string address;
        std::string node;
    };
    [[nodiscard]] place place_of(std::string_view target, const forwarding& by = {}) const;
    /// The node to which a request for the target is sent on its way there; empty if that is the target, or not known.
    [[nodiscard]] std::string neighbour_towards(std::string_view target, const forwarding& by) const;
    [[nodiscard]] std::optional<place> discovered_place_of(std::string_view target, const forwarding& by) const;
    url checked_url(std::string_view where) const;
    [[nodiscard]] std::string_view name_to_check(std::string_view target, std::string_view at,
                                                 std::string_view address) const;
    void reroute(peer_channel& channel);
    peer_channel* find(const destination& to, boost::system::error_code& code, std::string& why);

    local_node& host_;
    std::map<std::string, std::string, std::less<>> directory_;                  // the configured URLs, by node
    std::map<std::string, std::shared_ptr<peer_channel>, std::less<>> channels_; // by URL, name, and whether urgent
    std::string recent_target_; // most requests have the same target as the last
    peer_channel* recent_ = nullptr;
};

} // namespace cles::core
