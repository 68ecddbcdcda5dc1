// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/group_feeds.hpp"
#include "core/group_output.hpp"
#include "core/node.hpp"
#include "core/publisher_sources.hpp"
#include "port/group_source.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace cles::core {

/// What is told of the reserved task by the group.
class group_presence {
  public:
    group_presence() = default;
    group_presence(const group_presence&) = delete;
    group_presence& operator=(const group_presence&) = delete;
    /// `BIND all:cles`, or `BIND car1:cles` to this node of that name: somebody asks who is there.
    virtual void on_solicitation(bool by_name, time_point now) = 0;
    /// `UPDATE car1:cles seq= epoch= {...}` of another node, its body valid JSON; views are valid for the call.
    virtual void on_announcement(const group_source& from, const protocol::request_line& update, time_point now) = 0;

  protected:
    ~group_presence() = default;
};

/// What a node takes from its multicast group, by whichever of its interfaces it comes: updates for its feeds, and what
/// others say of themselves. The same may come by several interfaces, and is taken once.
class group_intake {
  public:
    /// `out` sends by all interfaces.
    group_intake(node& host, group_sender& out, std::uint32_t seed)
        : node_(host), feeds_(host, out, seed), sources_(host.others, host.bounds.publishers) {}

    /// From where this node sends by one of its interfaces.
    void add_own(const group_source& self) { own_.push_back(self); }
    /// Whether that is what this node has sent itself: the system brings it back, for others on this host, and an
    /// interface that is in the same network as another receives the other's.
    [[nodiscard]] bool is_own(const group_source& from) const noexcept {
        return std::find(own_.begin(), own_.end(), from) != own_.end();
    }
    /// Whether it comes from this host, as far as that shows.
    [[nodiscard]] bool is_of_this_host(const group_source& from) const noexcept {
        return from.is_loopback() || std::any_of(own_.begin(), own_.end(), [&](const group_source& self) {
                   return self.address == from.address;
               });
    }
    [[nodiscard]] const std::vector<group_source>& own() const noexcept { return own_; }

    /// Gets what concerns the reserved task from now on; null: nobody. It must outlive this.
    void attend(group_presence* presence) noexcept { presence_ = presence; }
    /// What comes from there is of another pool, and not heard until then.
    void pass_over(const group_source& from, time_point until) { sources_.note_foreign(from, until); }
    [[nodiscard]] bool is_passed_over(const group_source& from, time_point now) const noexcept {
        return sources_.is_foreign(from, now);
    }
    /// What this node is bound to.
    [[nodiscard]] group_feeds& feeds() noexcept { return feeds_; }

    /// Somebody asks who is there.
    void solicited(bool by_name, time_point now);
    /// An update of a node's name. False where it is of the reserved task and malformed.
    bool take(const group_source& from, const protocol::request_line& update, time_point now);

  private:
    bool take_announcement(const group_source& from, const protocol::request_line& update, time_point now);

    node& node_;
    std::vector<group_source> own_;
    group_feeds feeds_;
    publisher_sources sources_;
    group_presence* presence_ = nullptr;
};

} // namespace cles::core
