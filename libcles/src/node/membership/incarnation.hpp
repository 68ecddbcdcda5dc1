// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/membership/announcement.hpp"
#include "node/membership/reachable_endpoints.hpp"
#include "port/group_port.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

namespace cles::core {

/// Incarnations that have ended, so that older sightings do not bring them back. Bounded; each is kept until no such
/// sighting would be accepted.
class tombstones {
  public:
    struct entry {
        std::string node;
        std::uint64_t seq = 0; ///< of its last announcement
        time_point at{};       ///< when it ended
        time_point until{};    ///< when this expires
        bool graceful = false; ///< it announced that it leaves
        std::uint64_t revision = 0;
        std::shared_ptr<const signed_announcement> original{}; ///< its last signed announcement
        time_point last_seen{}; ///< it counts as alive after all if it was seen later; for signed announcements only

        [[nodiscard]] bool covers_hint(time_point announced_at) const noexcept {
            return graceful || announced_at <= last_seen;
        }
    };

    explicit tombstones(std::size_t most) noexcept : max_entries_(most) {}

    void add(std::uint32_t epoch, entry ended, time_point now);
    /// The incarnation is alive after all.
    void forget(std::uint32_t epoch) { entries_.erase(epoch); }
    /// Whether that announcement was made before the end, or for lack of a `seq` may have been.
    [[nodiscard]] bool covers(std::string_view node, std::uint32_t epoch, std::uint64_t seq) const noexcept {
        return covers(epoch, seq) && entries_.at(epoch).node == node;
    }
    /// The same without the name of the node.
    [[nodiscard]] bool covers(std::uint32_t epoch, std::uint64_t seq) const noexcept {
        const auto found = entries_.find(epoch);
        return found != entries_.end() && seq <= found->second.seq;
    }
    /// The same for a signed announcement. Its `seq` stays the same while nothing changes, so the time shows whether a
    /// node that had become silent is alive after all.
    [[nodiscard]] bool covers_signed(std::string_view node, std::uint32_t epoch, std::uint64_t seq,
                                     time_point announced_at) const noexcept {
        const auto found = entries_.find(epoch);
        return found != entries_.end() && found->second.node == node &&
               (seq < found->second.seq || (seq == found->second.seq && found->second.covers_hint(announced_at)));
    }
    /// The same for a heartbeat.
    [[nodiscard]] bool covers_heartbeat(std::uint32_t epoch, std::uint64_t seq,
                                        time_point announced_at) const noexcept {
        const auto found = entries_.find(epoch);
        return found != entries_.end() &&
               (found->second.original ? found->second.covers_hint(announced_at) : seq <= found->second.seq);
    }
    [[nodiscard]] const std::unordered_map<std::uint32_t, entry>& all() const noexcept { return entries_; }

  private:
    std::size_t max_entries_;
    std::unordered_map<std::uint32_t, entry> entries_; // by epoch
};

/// Finds an entry by the epoch of its incarnation. Two incarnations may have the same epoch, by chance or because of a
/// bad random source; such an epoch is ambiguous.
template <class T>
class epoch_index {
  public:
    void add(std::uint32_t epoch, T* what) { all_.emplace(epoch, what); }
    void remove(std::uint32_t epoch, T* what) {
        const auto [first, last] = all_.equal_range(epoch);
        const auto found = std::find_if(first, last, [what](const auto& each) { return each.second == what; });
        if (found != last) {
            all_.erase(found);
        }
    }
    /// Null if there is none, or more than one.
    [[nodiscard]] T* find(std::uint32_t epoch) const noexcept {
        const auto found = all_.find(epoch);
        return found == all_.end() || is_shared(epoch) ? nullptr : found->second;
    }
    [[nodiscard]] bool contains(std::uint32_t epoch) const noexcept { return all_.contains(epoch); }
    [[nodiscard]] bool is_shared(std::uint32_t epoch) const noexcept { return all_.count(epoch) > 1; }

  private:
    std::unordered_multimap<std::uint32_t, T*> all_;
};

/// An announcement of an incarnation, as received. Borrows what it refers to.
struct sighting {
    const announcement& announced;
    std::uint32_t epoch;
    std::uint64_t seq;       ///< 0: missing
    time_point announced_at; ///< when the node itself announced it
    group_source from;       ///< all zeros: received by gossip
    const observed_source& by;
    bool again = false; ///< of a signed one in the group: it has counted before

    [[nodiscard]] bool is_from_gossip() const noexcept { return from == group_source{}; }
    [[nodiscard]] bool is_signed() const noexcept { return announced.original != nullptr; }
    /// Whether it contains more than an address, as a plain table does.
    [[nodiscard]] bool describes() const noexcept { return seq != 0 || !announced.tasks.empty(); }
};

/// What is known of a node from one start to the next.
struct incarnation {
    std::uint32_t epoch = 0;
    group_source from;     ///< the source of its endpoints; all zeros: known by gossip only
    std::uint64_t seq = 0; ///< 0: missing
    time_point last_seen{};
    time_point last_seen_at_source{};     ///< from `from`
    std::uint64_t revision = 0;           ///< of the last sighting
    std::uint64_t described_revision = 0; ///< of the last change beyond a heartbeat
    std::uint32_t service_us = 0;         ///< as of `described_revision`
    announcement announced{};
    std::vector<std::string> endpoints;         ///< usable from here
    std::vector<std::string> relayed_endpoints; ///< as relayed to others

    /// From its first sighting; draws its revision from `numbers`.
    static incarnation first(const sighting& w, std::uint64_t& numbers);
    /// Applies a newer sighting.
    void apply(const sighting& w, std::uint64_t& numbers);
    /// Whether `now` differs from the known load by more than a heartbeat reports.
    [[nodiscard]] bool is_significant_load_change(const node_load& now) const noexcept;
    /// Applies the endpoints of a sighting. Returns whether they replaced the known ones.
    bool apply_endpoints(const sighting& w);
    /// Applies a sighting received again, by the same or another interface. Returns whether its endpoints replaced the
    /// known ones.
    bool on_repeat(const sighting& w);

    /// Whether it is of this incarnation. A signed one in the group states the sources, and a newer one may state
    /// others.
    [[nodiscard]] bool matches(const sighting& w) const noexcept {
        return epoch == w.epoch && (w.is_signed() || w.is_from_gossip() || may_send_from(w.from));
    }
    /// Whether `f` is a source of its own, as far as they are known.
    [[nodiscard]] bool may_send_from(const group_source& f) const noexcept {
        return from == group_source{} || sends_from(f);
    }
    /// Whether `f` is its source in the group, or one of its announced sources.
    [[nodiscard]] bool sends_from(const group_source& f) const noexcept {
        return from == f || std::find(announced.sources.begin(), announced.sources.end(), f) != announced.sources.end();
    }
    /// Whether `w` is a copy of the last announcement, sent by another of several interfaces.
    [[nodiscard]] bool is_repeated_by(const sighting& w) const noexcept {
        return !w.is_from_gossip() && !announced.sources.empty() && w.seq == seq;
    }
    /// Whether a sighting is newer than everything known. Of signed ones, only the `seq` counts.
    [[nodiscard]] bool is_older_than(const sighting& w) const noexcept {
        return w.is_signed() ? w.seq > seq : is_older_than(w.seq, w.announced_at);
    }
    /// Whether a signed announcement that is not newer, or a heartbeat, shows that the node was alive later.
    [[nodiscard]] bool is_hinted_alive(time_point announced_at, std::chrono::milliseconds interval) const noexcept {
        return announced.original != nullptr && announced_at >= last_seen + interval / 2;
    }
    /// The node was alive then, by a hint that is not signed.
    void on_hint(time_point announced_at, std::uint64_t& numbers) noexcept {
        last_seen = announced_at;
        revision = ++numbers;
    }
    /// Whether a sighting is newer than everything known.
    [[nodiscard]] bool is_older_than(std::uint64_t s, time_point announced_at) const noexcept {
        return seq != 0 && s != 0 ? s > seq : announced_at >= (s != 0 ? last_seen : last_seen + announced.interval / 2);
    }
    [[nodiscard]] std::string_view where() const noexcept {
        return endpoints.empty() ? std::string_view{} : std::string_view{endpoints.front()};
    }

  private:
    [[nodiscard]] bool is_better_endpoint_source(const sighting& w) const noexcept;
    [[nodiscard]] bool is_lost_in_group(const sighting& w) const noexcept;
};

/// A change of one incarnation to report. Views and pointers are valid until the table changes.
struct delta_entry {
    enum class kind : std::uint8_t {
        heartbeat,   ///< a new announcement; the rest is unchanged
        description, ///< the full entry
        leave,       ///< it has left; of another node, `announced` is null
    };
    kind what = kind::description;
    std::string_view node;
    const announcement* announced = nullptr;
    const std::vector<std::string>* endpoints = nullptr; ///< as relayed to others
    std::uint32_t epoch = 0;
    std::uint64_t seq = 0;
    time_point last_seen{};
    peer_state state = peer_state::live;
    std::uint64_t revision = 0;                    ///< the order of changes
    const signed_announcement* original = nullptr; ///< null: it is not signed

    static delta_entry of(kind what, std::string_view node, const incarnation& run, peer_state state) noexcept {
        return {what,    node,          &run.announced, &run.relayed_endpoints, run.epoch,
                run.seq, run.last_seen, state,          run.revision,           run.announced.original.get()};
    }
};

} // namespace cles::core
