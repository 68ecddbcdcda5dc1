// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/gossip.hpp>
#include <cles/limits.hpp>

#include "node/membership/announcer.hpp"
#include "node/membership/membership.hpp"
#include "node/publish/group_dispatcher.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {
class local_node;
} // namespace cles::core

namespace cles::detail {

/// The gossip of a service, as seen by the rest of the service.
class gossip_service {
  public:
    gossip_service() = default;
    gossip_service(const gossip_service&) = delete;
    gossip_service& operator=(const gossip_service&) = delete;
    virtual ~gossip_service() = default;

    /// \throws cles::error if one of them is not a usable URL
    virtual void set_seeds(const std::vector<std::string>& seeds) = 0;
    virtual void start() = 0;
    /// Announces that this node leaves, and keeps asking.
    virtual void leave() = 0;
    /// Leaves, and stops asking.
    virtual void stop() = 0;
    /// A node was removed without having left.
    virtual void on_gone(std::string_view node, std::string_view where, time_point now) = 0;
};

/// Creates the gossip of a service, which from then on also answers the gossip requests of others.
struct gossip_part {
    std::unique_ptr<gossip_service> (*make)(core::local_node& host, std::uint32_t seed);
};

} // namespace cles::detail

namespace cles::core {

class local_node;

class multicast_group;

/// Finds the other nodes and announces this one, in the multicast group and by gossip. Without either, it finds none.
class discovery final : private core::announcement_listener,
                        private core::membership::watcher,
                        private core::membership::prober,
                        private core::announcer::sender,
                        private core::discovery_grace::listener {
  public:
    discovery(local_node& host, std::uint32_t seed);
    discovery(const discovery&) = delete;
    discovery& operator=(const discovery&) = delete;
    ~discovery();

    /// Uses that group from now on.
    void join(multicast_group& through);
    /// Takes part in gossip from now on, with these seeds. \throws cles::error if a seed is not a usable URL
    void gossip(const gossip_options& how);
    /// Starts once the environment runs.
    void start();
    /// Announces that this node leaves, and keeps receiving. Further calls do nothing.
    void leave();
    /// Leaves, and stops.
    void stop();

    /// See `membership::address_of`.
    [[nodiscard]] std::optional<std::string_view> address_of(std::string_view node) const noexcept;
    /// See `membership::conflicting_endpoint_of`.
    [[nodiscard]] std::optional<std::string_view> conflicting_endpoint_of(std::string_view node) const noexcept;
    /// Solicits an announcement of that node.
    void solicit(std::string_view node);
    /// Whether an unknown name may still be announced at any moment.
    [[nodiscard]] bool expects_more() const noexcept { return !discovery_grace_.over(); }
    /// Whether a node that is known, but at no usable address, may still be received by another of its interfaces.
    [[nodiscard]] bool expects_more_of(std::string_view node) const noexcept;
    /// Receives the changes of `membership`; a test may intercept them.
    [[nodiscard]] core::membership::watcher& membership_watcher() noexcept { return *this; }
    /// Why a name is unknown, as the start of a sentence; empty without a group and gossip.
    [[nodiscard]] std::string unknown_reason() const;

  private:
    void begin();
    void announce(std::chrono::milliseconds interval) override;
    void announce(std::chrono::milliseconds interval, bool leaving);
    [[nodiscard]] std::size_t others() const override;
    void on_discovery_grace_over() override;
    void on_solicitation(bool by_name, time_point now) override;
    void on_announcement(const core::group_source& from, const protocol::request_line& update, time_point now) override;
    void on_peer(std::string_view node, core::membership::change what, std::string_view where) override;
    void probe(std::uint64_t ticket, std::string_view url) override;
    void follow_incarnation(const std::string& name);
    void on_name_taken(const std::string& where);
    void announce_to_group(core::announcement& said);
    [[nodiscard]] std::vector<std::string> endpoints_for_group(bool loopback) const;
    [[nodiscard]] std::vector<std::string> endpoints_for_gossip() const;

    local_node& host_;
    core::announcer announcer_;
    core::discovery_grace discovery_grace_;
    std::unique_ptr<detail::gossip_service> gossip_driver_; // null: it takes no part
    std::uint32_t seed_;
    multicast_group* group_ = nullptr;
    std::map<std::string, std::uint32_t, std::less<>> incarnations_; // epoch by name
    std::uint64_t seq_ = 0;
    bool begun_ = false;
    bool left_ = false;
};

} // namespace cles::core
