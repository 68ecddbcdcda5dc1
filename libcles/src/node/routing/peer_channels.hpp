// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include "node/routing/peer_channel.hpp"
#include "node/session/connection.hpp"
#include "node/session/outbound.hpp"
#include "protocol/request_line.hpp"

#include <boost/system/error_code.hpp>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// The configured URLs of nodes.
class directory {
  public:
    /// An empty URL removes the node.
    void set(std::string_view name, std::string_view url) {
        if (url.empty()) {
            if (const auto found = urls_.find(name); found != urls_.end()) {
                urls_.erase(found);
            }
        } else {
            urls_.insert_or_assign(std::string{name}, std::string{url});
        }
    }
    /// Empty if the node has no URL.
    [[nodiscard]] std::string_view find(std::string_view name) const noexcept {
        const auto found = urls_.find(name);
        return found == urls_.end() ? std::string_view{} : std::string_view{found->second};
    }

  private:
    std::map<std::string, std::string, std::less<>> urls_;
};

class feed_machine;

class local_node;

/// The channels of a service, and which of them leads to a node: first the configured URL, then a service on the same
/// context, then the address that the node itself announces.
class peer_channels {
  public:
    explicit peer_channels(local_node& host) noexcept : host_(host) {}

    /// Configures the URL of a node; an empty URL removes it. \throws cles::error
    void set_peer(std::string_view name, std::string_view where);
    /// The channel to a target, or null with the reason in `code` and `why`. It may only hold requests for a node that
    /// is not discovered yet. Urgent requests have links of their own.
    peer_channel* to(std::string_view target, std::string_view at, bool urgent, boost::system::error_code& code,
                     std::string& why);
    /// Sends a request to a target, or to `at` if it is not empty, and gives it an id. Without a channel that leads
    /// there, the operation fails later. Returns the id, or 0.
    std::uint64_t send(std::string_view target, std::string_view at, protocol::outgoing_request r, time_point deadline,
                       detail::pending_ptr operation, outbound::progress_function progress);
    /// The address of the node has become known, unknown, or another.
    void on_address_changed(std::string_view node);
    /// Resolves or fails the names that wait for discovery.
    void on_discovery_grace_over();

    /// Cancels a request that waits for its link. Returns false if there is none with that id.
    bool cancel(std::uint64_t id);
    /// The feed no longer waits for a link.
    void forget(const core::feed_machine& feed);
    /// `c` was lost or can no longer be used.
    void drop(const connection& c);
    /// No requests follow at that URL for a while: closes its idle links.
    void release(std::string_view url);
    /// Stops dialling, and fails the waiting requests.
    void stop();

  private:
    [[nodiscard]] std::string address_of(std::string_view target) const;
    peer_channel* find(std::string_view target, std::string_view at, bool urgent, boost::system::error_code& code,
                       std::string& why);

    local_node& host_;
    core::directory directory_;
    std::map<std::string, std::shared_ptr<peer_channel>, std::less<>> channels_; // by URL, and whether urgent
    std::string recent_target_; // most requests have the same target as the last
    peer_channel* recent_ = nullptr;
};

} // namespace cles::core
