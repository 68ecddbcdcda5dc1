// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/peer.hpp>

#include "node/base/deadlines.hpp"
#include "node/membership/announcement.hpp"
#include "node/membership/incarnation.hpp"
#include "node/membership/name_conflict.hpp"
#include "port/group_port.hpp"

#include <chrono>
#include <cstddef>
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

/// The other nodes, as known from their announcements and from gossip (docs/protocol.md, "Membership" and "Gossip").
///
/// A name belongs to the incarnation that was first received under it (the owner), for as long as it is live: only the
/// owner, from its own sources, moves the name or leaves. Another incarnation that announces the same name (the
/// contender) waits. If the owner becomes silent, it was a restart, and the name passes to the contender. If both are
/// received alternately, it is a name conflict: it is reported, and the contender gets no requests, but the owner does.
///
/// With a prober this is decided sooner, by asking the owner. If it does not answer, the name passes at once; if both
/// incarnations answer, it is a name conflict.
///
/// What carries the owner's epoch is of the owner, and never a conflict, whatever source it is received from: others
/// may repeat what it sends.
class membership final : private deadline {
  public:
    enum class change : std::uint8_t {
        appeared,
        moved,    ///< the name is at another address, of this incarnation or the next
        silent,   ///< it became suspect
        returned, ///< it is received again
        left,     ///< it announced that it leaves
        gone,     ///< it was removed without a leave
        clash,    ///< a second live node has this name
        taken,    ///< this node's own name belongs to another live node, which was there first
        relinked, ///< it has announced other `links`
    };
    /// Is notified after each change. `where`: the URL at which the node is or was reached, or for `clash` where the
    /// contender was received from. It may be empty.
    class watcher {
      public:
        watcher() = default;
        watcher(const watcher&) = delete;
        watcher& operator=(const watcher&) = delete;
        virtual void on_peer(std::string_view node, change what, std::string_view where) = 0;

      protected:
        ~watcher() = default;
    };

    using prober = name_conflicts::prober;

    enum class verdict : std::uint8_t {
        taken,
        own,       ///< this node's own announcement, returned by the group
        old,       ///< outdated, repeated, or of an incarnation that has left
        duplicate, ///< a copy, received by another of several interfaces
        copied,    ///< from a source that is not one of its node's: others have repeated it
        refused,   ///< the table is full
        unknown,   ///< a heartbeat of an incarnation without a description
        foreign,   ///< of another pool
    };
    /// What is needed to send requests to a node. Views are valid until the next change.
    struct member {
        std::string_view node;
        std::string_view where; ///< empty: no address is usable from here
        std::uint32_t epoch = 0;
        bool suspect = false;
        std::string_view tasks; ///< digest of its tasks
        node_load load;
    };

    membership(std::string own_name, std::uint32_t own_epoch, deadline_queue& deadlines, std::size_t most)
        : own_name_(std::move(own_name)), own_epoch_(own_epoch), deadlines_(deadlines), max_peers_(most), ended_(most) {
    }
    void watch(watcher* who) noexcept { watcher_ = who; }
    /// Calls `on_seen` after each accepted sighting of a node and after each of its changes, including its removal.
    void observe(std::function<void(std::string_view node)> on_seen) noexcept { on_seen_ = std::move(on_seen); }
    void set_prober(prober by) noexcept { conflicts_.set_prober(std::move(by)); }
    /// This node has started and belongs to `pool`. Sightings by or of nodes of other pools are ignored.
    void begin(std::string_view pool, time_point now) {
        own_pool_ = pool;
        conflicts_.begin(now);
    }
    [[nodiscard]] const std::string& pool() const noexcept { return own_pool_; }

    /// Applies an announcement received by multicast. One that is signed states the source.
    /// \param again if it is signed: one of that incarnation with this `seq`, or a later one, has been applied before
    verdict apply_announcement(const announcement& said, std::uint32_t epoch, std::uint64_t seq,
                               const group_source& from, time_point now, bool again = false);
    /// Whether that incarnation has been received in the group, from other sources only.
    [[nodiscard]] bool is_elsewhere(std::string_view node, std::uint32_t epoch,
                                    const group_source& from) const noexcept;
    /// Applies a load report received by multicast: the node, known by its signed announcement, is alive, and has this
    /// load. `seq` is that of its last announcement.
    verdict apply_load(std::string_view node, std::uint32_t epoch, std::uint64_t seq, const node_load& load,
                       const group_source& from, time_point now);
    /// Applies what another node reported. `asked`: when the request for it was sent; ages count from then.
    verdict apply_gossip(const peer_report& report, const observed_source& by, time_point asked, time_point now);
    verdict apply_gossip(const peer_heartbeat& beat, time_point asked, time_point now);
    /// Whether that signed announcement is known already.
    [[nodiscard]] bool holds(const peer_report& report) const noexcept;
    /// Whether this node's own announcement has changed by more than heartbeats report.
    [[nodiscard]] bool has_news(const announcement& own) const noexcept;
    /// Records this node's own announcement. From now on it is reported to others.
    void announce_self(const announcement& own, std::uint64_t seq, time_point now);
    /// Records that this node leaves. From now on it is reported as left.
    void leave(time_point now);
    /// This node as last announced; null before the first `announce_self`.
    [[nodiscard]] const incarnation* own() const noexcept { return own_ ? &*own_ : nullptr; }
    /// The name for which a probe was sent; empty if the ticket is unknown.
    [[nodiscard]] std::string_view probed_name(std::uint64_t ticket) const noexcept {
        return conflicts_.probed_name(ticket);
    }
    /// The outcome of a probe.
    void on_probed(std::uint64_t ticket, const probe_outcome& found, time_point now);
    /// Where a second live node of that name is, which gets no requests: its URL, or its host if none is usable from
    /// here. Empty if there is none.
    [[nodiscard]] std::string second_of(std::string_view node) const;
    /// This node was suspended and could not receive anything: failure detection starts over.
    void note_suspension(time_point now) noexcept { resumed_at_ = now; }

    /// The URL at which the node is reached; nothing if it is unknown, empty if none of its addresses is usable from
    /// here. Valid until the next change.
    [[nodiscard]] std::optional<std::string_view> address_of(std::string_view node) const noexcept;
    /// The node of that incarnation; null if it is unknown, or not the owner of its name.
    [[nodiscard]] const std::string* owner_of(std::uint32_t epoch) const noexcept;
    /// That incarnation of the node has replied at the URL: it is used instead of an address of the same kind that
    /// others have reported. `announced`: only if it is one of those that the node announces.
    void prefer_address(std::string_view node, std::string_view epoch, std::string_view url, bool announced = false);
    /// Reports the node again to those that ask for changes.
    void touch(std::string_view node);
    /// The same for the owner of a name, by its epoch.
    void touch(std::uint32_t epoch);
    /// The number of other nodes.
    [[nodiscard]] std::size_t size() const noexcept { return peers_.size(); }
    /// The limit of `size`.
    [[nodiscard]] std::size_t max_peers() const noexcept { return max_peers_; }
    /// All nodes by name; the contender of a name conflict follows the owner.
    [[nodiscard]] std::vector<peer> list(time_point now) const;

    /// The owner of the name; null if there is none. Valid until the next change.
    [[nodiscard]] const incarnation* owner(std::string_view node) const noexcept;
    /// The same; null too if it was not received in the group.
    [[nodiscard]] const incarnation* announced(std::string_view node) const noexcept;
    /// Nothing if the node is unknown.
    [[nodiscard]] std::optional<member> find_member(std::string_view node) const;
    /// The node with the next name; after the last the first; nothing if none is known.
    [[nodiscard]] std::optional<member> next_member(std::string_view node) const;
    /// The node at `index` in the order of names; `index` is less than `size`.
    [[nodiscard]] member at(std::size_t index) const;

    /// Calls `what` with each node, by name.
    template <class F>
    void for_each(F&& what) const {
        for (const auto& one : peers_) {
            what(member_of(one));
        }
    }
    /// Calls `what` with the name and the owner of each node that is not suspect.
    template <class F>
    void for_each_live(F&& what) const {
        for (const auto& [name, one] : peers_) {
            if (!one.suspect) {
                what(name, one.owner);
            }
        }
    }

    /// The entries to report that are newer than `revision`, in order.
    [[nodiscard]] std::vector<delta_entry> deltas_since(std::uint64_t revision, time_point now) const;
    /// The full entry of an incarnation; nothing if it is unknown, or reported in full anyway.
    [[nodiscard]] std::optional<delta_entry> description_of(std::uint32_t epoch) const;
    /// The same for the owner of a name.
    [[nodiscard]] std::optional<delta_entry> entry_of(std::string_view node) const;
    /// The newest revision.
    [[nodiscard]] std::uint64_t latest_revision() const noexcept { return revision_; }

  private:
    struct entry;
    using named_entry = std::pair<const std::string, entry>;
    struct entry {
        incarnation owner;
        bool suspect = false;
        std::unique_ptr<name_conflict> second;
        std::list<named_entry*>::iterator in_revision_order{};
        time_point since{}; // when the owner became known
        /// The owner, as it is received from a source that is not one of its own, and at another address: others repeat
        /// its announcements, or its address has changed. Not a conflict.
        std::unique_ptr<name_conflict> elsewhere{};

        /// For which that probe was sent; null if there is none.
        [[nodiscard]] name_conflict* asked_by(std::uint64_t ticket) const noexcept {
            return second && second->check.ticket == ticket         ? second.get()
                   : elsewhere && elsewhere->check.ticket == ticket ? elsewhere.get()
                                                                    : nullptr;
        }
        [[nodiscard]] peer_state state() const noexcept { return suspect ? peer_state::suspect : peer_state::live; }
    };
    using entries = std::map<std::string, entry, std::less<>>;

    static member member_of(const entries::value_type& one) noexcept {
        const auto& [name, e] = one;
        return {name, e.owner.where(), e.owner.epoch, e.suspect, e.owner.announced.tasks, e.owner.announced.load};
    }

    [[nodiscard]] std::chrono::milliseconds interval_of(const announcement& said, const group_source& from) const;
    /// Received by gossip, and too old to make an unknown node known.
    [[nodiscard]] bool is_stale(const sighting& w, time_point now) const;
    [[nodiscard]] time_point suspect_at(const incarnation& r) const;
    [[nodiscard]] time_point expires_at(const incarnation& r) const;
    incarnation first_sighting(const sighting& w);
    verdict take_sighting(const sighting& w, time_point now);
    verdict take_owner_sighting(entries::iterator at, const sighting& w, time_point now);
    verdict take_sighting_elsewhere(entries::iterator at, const sighting& w, time_point now);
    void check_new_address(named_entry& one, const sighting& w, time_point now);
    void note_elsewhere(named_entry& one, const sighting& w, time_point now);
    verdict take_own_name_sighting(const sighting& w, time_point now);
    verdict take_conflicting_sighting(std::unique_ptr<name_conflict>& second, const sighting& w, time_point now);
    verdict take_leave(const sighting& w, time_point now);
    [[nodiscard]] bool is_of_ended(const sighting& w) const noexcept;
    /// The incarnation of a name with that epoch, as owner or contender; null if it is not known.
    [[nodiscard]] const incarnation* find_run(std::string_view node, std::uint32_t epoch) const noexcept;
    [[nodiscard]] bool is_hinted_alive(const incarnation& r, time_point announced_at) const {
        return r.is_hinted_alive(announced_at, interval_of(r.announced, r.from));
    }
    void swap_with_contender(entries::iterator at);
    void report_conflict(name_conflict& conflict);
    void on_owner_seen(named_entry& one, bool moved, bool by_gossip, time_point now);
    void end(entries::iterator at, change how, time_point now);
    void succeed(entries::iterator at, incarnation next);
    void remember(const std::string& node, const incarnation& over, bool graceful, time_point now);
    void drop_second(entries::iterator at);
    /// Moves an entry with a new revision to the end.
    void freshen(named_entry& one) {
        by_revision_.splice(by_revision_.end(), by_revision_, one.second.in_revision_order);
    }
    void on_deadline(time_point now) override;
    void follow(time_point due);
    void notify(std::string_view node, change what, std::string_view where) const;
    void notify_seen(std::string_view node) const;

    const std::string own_name_;
    const std::uint32_t own_epoch_;
    std::string own_pool_;
    deadline_queue& deadlines_;
    const std::size_t max_peers_;
    watcher* watcher_ = nullptr;
    std::function<void(std::string_view node)> on_seen_;
    name_conflicts conflicts_;
    entries peers_;
    std::list<named_entry*> by_revision_; // the newest last
    epoch_index<named_entry> by_epoch_;
    std::unique_ptr<name_conflict> own_name_conflict_; // for this node's own name
    std::optional<incarnation> own_;                   // as last announced
    time_point own_since_{};
    tombstones ended_;
    std::uint64_t revision_ = 0;
    time_point resumed_at_ = time_point::min();
};

} // namespace cles::core
