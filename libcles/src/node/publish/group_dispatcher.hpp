// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/node_state.hpp"
#include "node/publish/group_feeds.hpp"
#include "node/publish/group_output.hpp"
#include "port/group_source.hpp"
#include "protocol/request_line.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

class membership;

/// Decides from which sources a publisher's updates are accepted in the multicast group: from those of the incarnation
/// that owns the name (one source for each interface; its announcements list the others). A publisher that does not
/// announce itself is bound to the source from which it was first received, until that falls silent; no other source
/// can displace it by sending updates under its name. Sources of other pools are ignored.
class publisher_sources {
  public:
    static constexpr std::chrono::milliseconds silent_after{3'500};

    publisher_sources(const membership& others, std::size_t most) noexcept : others_(others), max_entries_(most) {}

    enum class verdict : std::uint8_t {
        refused,
        taken,
        one_of_several, ///< accepted; the same update may arrive from another of its sources
        another,        ///< accepted, from another source than before: the known sequence does not apply
    };
    /// Decides on an update of that node from this source; accepting it keeps the source binding alive.
    verdict look(std::string_view node, const group_source& from, time_point now);
    /// The source belongs to another pool, until then.
    void note_foreign(const group_source& from, time_point until);
    [[nodiscard]] bool is_foreign(const group_source& from, time_point now) const noexcept {
        const auto found = foreign_.find(from);
        return found != foreign_.end() && found->second > now;
    }
    [[nodiscard]] std::size_t size() const noexcept { return source_bindings_.size(); }

  private:
    struct source_binding {
        group_source to;
        time_point heard{};
    };

    const membership& others_;
    std::size_t max_entries_;
    std::map<std::string, source_binding, std::less<>> source_bindings_; // of those that do not announce themselves
    boost::unordered_flat_map<group_source, time_point> foreign_;
};

/// Receives what the group sends about the reserved task.
class announcement_listener {
  public:
    announcement_listener() = default;
    announcement_listener(const announcement_listener&) = delete;
    announcement_listener& operator=(const announcement_listener&) = delete;
    /// `BIND all:cles`, or `BIND car1:cles` with this node's name: a node looks for others.
    virtual void on_solicitation(bool by_name, time_point now) = 0;
    /// `UPDATE car1:cles seq= epoch= {...}` of another node. Its body is valid JSON; views are valid during the call.
    virtual void on_announcement(const group_source& from, const protocol::request_line& update, time_point now) = 0;

  protected:
    ~announcement_listener() = default;
};

/// Dispatches what a node receives from its multicast group, on any of its interfaces: updates for its feeds, and
/// announcements. The same update may arrive on several interfaces, and is accepted once.
class group_dispatcher {
  public:
    /// `out` sends on all interfaces.
    group_dispatcher(node_state& host, group_sender& out, std::uint32_t seed)
        : node_(host), feeds_(host, out, seed), sources_(host.peers, host.bounds.publishers) {}

    /// Adds the source from which this node sends on one of its interfaces.
    void add_own(const group_source& self) { own_.push_back(self); }
    /// Whether this node sent it itself: the system loops datagrams back for others on this host, and interfaces in the
    /// same network receive each other's.
    [[nodiscard]] bool is_own(const group_source& from) const noexcept {
        return std::find(own_.begin(), own_.end(), from) != own_.end();
    }
    /// Whether it comes from this host, as far as that can be determined.
    [[nodiscard]] bool is_of_this_host(const group_source& from) const noexcept {
        return from.is_loopback() || std::any_of(own_.begin(), own_.end(), [&](const group_source& self) {
                   return self.address == from.address;
               });
    }
    [[nodiscard]] const std::vector<group_source>& own() const noexcept { return own_; }

    /// `membership` receives what concerns the reserved task from now on; null: nobody. It must outlive this.
    void set_listener(announcement_listener* membership) noexcept { listener_ = membership; }
    /// Ignores the source until then: it belongs to another pool.
    void ignore_until(const group_source& from, time_point until) { sources_.note_foreign(from, until); }
    [[nodiscard]] bool is_ignored(const group_source& from, time_point now) const noexcept {
        return sources_.is_foreign(from, now);
    }
    /// The feeds that are bound through the group.
    [[nodiscard]] group_feeds& feeds() noexcept { return feeds_; }

    /// A node looks for others.
    void solicited(bool by_name, time_point now);
    /// An update under a node's name. False if it is of the reserved task and malformed.
    bool take(const group_source& from, const protocol::request_line& update, time_point now);

  private:
    bool take_announcement(const group_source& from, const protocol::request_line& update, time_point now);

    node_state& node_;
    std::vector<group_source> own_;
    group_feeds feeds_;
    publisher_sources sources_;
    announcement_listener* listener_ = nullptr;
};

} // namespace cles::core
