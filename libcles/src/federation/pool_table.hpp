// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "federation/heartbeat.hpp"
#include "federation/subject.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace cles::bridging {

/// The pools, their bridges, and the names of their nodes, as the bridges state them.
class pool_table {
  public:
    static constexpr std::size_t max_pools = 1024;
    static constexpr std::size_t max_bridges = 4096;
    static constexpr std::size_t max_names = 65'536;
    static constexpr std::chrono::hours kept_for{1}; ///< a pool without bridges

    struct bridge {
        std::string node;
        std::chrono::milliseconds interval{0};
        std::string names; ///< the digest of those that it has stated last, and that are known
        time_point heard;
        time_point since; ///< when it was first received
        bool is_closing = false;
    };
    struct pool {
        std::map<std::string, bridge, std::less<>> bridges; ///< that are live, by instance
        /// Names of nodes by their digest: what the bridges have stated, which may know different nodes, or the last
        /// that were received. The pool has all of these.
        std::map<std::string, std::vector<std::string>, std::less<>> names;
        time_point without_bridges; ///< since when, if there is none
        bool has_left = false;      ///< its last bridge has said that it leaves
    };
    enum class arrival : std::uint8_t {
        known,
        fresh,
        returned, ///< it was taken for lost
        ignored   ///< there are too many
    };

    /// A bridge says that it lives.
    arrival on_heartbeat(const bridge_id& from, const heartbeat& said, time_point now);
    /// A bridge that is about to be removed says that it leaves.
    void note_leaving(const bridge_id& gone);
    /// Removes a bridge. Returns false if it is not known.
    bool remove(const bridge_id& gone, time_point now);
    using condition = std::function<bool(const std::string& instance, const bridge& which)>;
    /// The same for those that do not know that they are lost: if they return, they are told. Returns them.
    std::vector<bridge_id> lose_if(const condition& is_lost, time_point now);
    /// Loses those that were silent for too long, and returns them.
    std::vector<bridge_id> expire(time_point now);
    /// Nothing could be received for a while: silence counts from now on.
    void note_suspension(time_point now);
    /// All bridges are unknown from now on. The pools, and the names of their nodes, remain known.
    void clear(time_point now);
    /// Bridges can be received again. Pools that have none are kept for a while from now on.
    void note_connection(time_point now);
    /// Removes the pools that have had no bridge for too long. Returns whether there were any.
    bool forget_pools(time_point now);

    /// What that bridge says of its pool. Returns whether anything has changed.
    bool set_names(const bridge_id& from, node_names said);
    /// Whether the names with that digest are to be asked for.
    [[nodiscard]] bool lacks_names(std::string_view of, std::string_view digest) const;
    /// How many nodes the pool has.
    [[nodiscard]] static std::size_t node_count(const pool& of);

    [[nodiscard]] bool is_known(std::string_view name) const { return pools_.contains(name); }
    [[nodiscard]] bool is_live(std::string_view name) const;
    [[nodiscard]] bool is_live(const bridge_id& which) const;
    /// Whether it had bridges, and the last one has left in order: none is expected to return soon.
    [[nodiscard]] bool has_left(std::string_view name) const;
    [[nodiscard]] std::size_t bridge_count() const noexcept { return bridge_count_; }
    /// The pool that has a node of this name, apart from `except`; live ones first. Empty if there is none.
    [[nodiscard]] std::string_view pool_of(std::string_view node, std::string_view except) const;
    /// The bridge of the pool that publishes this noun for other pools, one that is not closing if there is any. All
    /// who know the same bridges select the same one. Empty if there is none.
    [[nodiscard]] std::string_view publisher_of(std::string_view of, std::string_view noun) const;
    /// A bridge of the pool that takes requests, by `turn`, whose values are shared out evenly. Empty if there is none.
    [[nodiscard]] std::string_view taker_of(std::string_view of, std::uint32_t turn) const;
    [[nodiscard]] const std::map<std::string, pool, std::less<>>& pools() const noexcept { return pools_; }

  private:
    bool make_room();
    void lose(const bridge_id& which, time_point now);

    std::map<std::string, pool, std::less<>> pools_;
    std::set<bridge_id> lost_; ///< that may not know it
    std::size_t bridge_count_ = 0;
};

} // namespace cles::bridging
