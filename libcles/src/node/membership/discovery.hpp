// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/gossip.hpp>
#include <cles/limits.hpp>

#include "node/base/backoff.hpp"
#include "node/base/deadlines.hpp"
#include "node/membership/membership.hpp"
#include "node/publish/multicast_group.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

class gossip;
class local_node;

/// The time after its start in which an unknown name may still become known: first, a node solicits announcements from
/// its group. Then it waits for the seeds that have neither answered nor refused: on a busy machine, they may be late.
class discovery_grace final : private deadline {
  public:
    static constexpr std::chrono::milliseconds length{300}; ///< of the first part
    /// Of both, if a seed is silent. It ends before the usual deadline of a request, so that the request fails with the
    /// reason.
    static constexpr std::chrono::milliseconds for_seeds{4'000};

    /// `on_change` is called at the end of each part.
    discovery_grace(deadline_queue& deadlines, std::function<void()> on_change)
        : deadlines_(deadlines), on_change_(std::move(on_change)) {}

    /// The grace period will start; its time is not running yet.
    void expect() noexcept { over_ = false; }
    void begin(time_point now, bool awaits_seeds = false);
    /// Every seed has answered or refused.
    void on_seeds_heard();
    void stop() noexcept;
    [[nodiscard]] bool over() const noexcept { return over_; }

  private:
    void on_deadline(time_point now) override;

    deadline_queue& deadlines_;
    std::function<void()> on_change_;
    bool over_ = true;
    bool awaits_seeds_ = false;
    bool is_for_seeds_ = false;
};

/// Decides when a node announces itself to its group (docs/protocol.md, "Membership"): once per interval, a little
/// sooner each time so that nodes do not announce in step; soon after a solicitation, but with a pause between any two.
/// Changes wait for the next announcement, which keeps the load on receivers steady.
class announcer final : private deadline {
  public:
    class sender {
      public:
        sender() = default;
        sender(const sender&) = delete;
        sender& operator=(const sender&) = delete;
        /// Sends an announcement now; the next one follows within `interval`.
        virtual void announce(std::chrono::milliseconds interval) = 0;
        /// The number of other known nodes.
        [[nodiscard]] virtual std::size_t others() const = 0;

      protected:
        ~sender() = default;
    };

    static constexpr std::chrono::milliseconds pause{100};         ///< between two announcements, at least
    static constexpr std::chrono::milliseconds answer_within{250}; ///< after a solicitation

    announcer(sender& owner, deadline_queue& deadlines, std::uint32_t seed) noexcept
        : owner_(owner), deadlines_(deadlines), jitter_(seed) {}

    /// Starts announcing; before this, no other call has an effect.
    void start(time_point now);
    /// This node alone was solicited: announces without delay.
    void expedite(time_point now) { announce_by(now); }
    /// All nodes were solicited: announces after a random delay.
    void solicited(time_point now);
    void stop() noexcept;

  private:
    void announce_by(time_point due);
    void on_deadline(time_point now) override;

    sender& owner_;
    deadline_queue& deadlines_;
    jitter jitter_;
    time_point last_{};
    bool started_ = false;
};

/// Finds the other nodes and announces this one, in the multicast group and by gossip. Without either, it finds none.
class discovery final : private announcement_listener, private membership::watcher, private announcer::sender {
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

    /// Solicits an announcement of that node.
    void solicit(std::string_view node);
    /// Whether an unknown name may still be announced at any moment.
    [[nodiscard]] bool expects_more() const noexcept { return !discovery_grace_.over(); }
    /// Whether a node that is known, but at no usable address, may still be received by another of its interfaces.
    [[nodiscard]] bool expects_more_of(std::string_view node) const noexcept;
    /// Announces this node soon, since something has changed.
    void expedite_announcement();
    /// Every seed has answered or refused.
    void on_seeds_heard() { discovery_grace_.on_seeds_heard(); }
    /// Receives the changes of `membership`; a test may intercept them.
    [[nodiscard]] membership::watcher& membership_watcher() noexcept { return *this; }
    /// Why a name is unknown, as the start of a sentence; empty without a group and gossip.
    [[nodiscard]] std::string unknown_reason() const;

  private:
    void check_links(const std::vector<std::string>& nodes) const;
    void begin();
    void announce(std::chrono::milliseconds interval) override;
    void announce(std::chrono::milliseconds interval, bool leaving);
    [[nodiscard]] std::size_t others() const override;
    void on_solicitation(bool by_name, time_point now) override;
    void on_announcement(heard_announcement heard, time_point now) override;
    void on_interfaces_changed(time_point now) override;
    void on_peer(std::string_view node, membership::change what, std::string_view where) override;
    void probe(std::uint64_t ticket, const std::string& url);
    void follow_incarnation(const std::string& name);
    void announce_to_group(announcement& said);
    void announce_signed(announcement& said);
    [[nodiscard]] std::vector<group_source> sources_in_group() const;
    [[nodiscard]] std::vector<std::string> endpoints_for_group(bool loopback) const;
    [[nodiscard]] std::vector<std::string> endpoints_for_gossip() const;

    local_node& host_;
    announcer announcer_;
    discovery_grace discovery_grace_;
    std::unique_ptr<core::gossip> gossip_; // null: it takes no part
    std::uint32_t seed_;
    multicast_group* group_ = nullptr;
    std::map<std::string, std::uint32_t, std::less<>> incarnations_; // epoch by name
    std::uint64_t seq_ = 0;
    bool begun_ = false;
    bool left_ = false;
    bool asks_again_ = false; // the group, after the next announcement
};

} // namespace cles::core
