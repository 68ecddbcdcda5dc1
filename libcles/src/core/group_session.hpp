// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/group_bindings.hpp"
#include "core/group_feeds.hpp"
#include "core/group_output.hpp"
#include "core/group_source.hpp"
#include "core/group_welcomes.hpp"
#include "core/node.hpp"
#include "core/publisher_sources.hpp"
#include "protocol/message.hpp"

#include <cstdint>
#include <memory>
#include <string_view>

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

/// What a node makes of what it receives in its multicast group (docs/protocol.md, "Multicast"): BIND of `all:` or of a
/// node's name, and updates. All else is dropped and counted, and nothing is ever answered there.
class group_session {
  public:
    /// `self`: where what this node sends comes from.
    group_session(const std::shared_ptr<node>& host, const group_source& self, group_output& out, std::uint32_t seed)
        : node_(*host), self_(self), bindings_(*host, out, seed),
          welcomes_(host,
                    [this](const group_source& from, const protocol::request_line& bind) {
                        if (!bindings_.bind(from, bind, node_.time.now())) {
                            ++node_.counts.group_dropped;
                        }
                    }),
          feeds_(*host, out, ~seed), sources_(host->others, host->bounds.publishers) {}

    /// Gets what concerns the reserved task from now on; null: nobody. It must outlive this.
    void attend(group_presence* presence) noexcept { presence_ = presence; }

    /// What others are bound to here.
    [[nodiscard]] group_bindings& bindings() noexcept { return bindings_; }
    /// Nobody is bound any more, nor will be who has asked.
    void unbind_all() {
        welcomes_.clear();
        bindings_.clear();
    }
    /// What comes from there is of another pool, and not heard until then.
    void pass_over(const group_source& from, time_point until) { sources_.note_foreign(from, until); }
    /// What this node is bound to.
    [[nodiscard]] group_feeds& feeds() noexcept { return feeds_; }

    /// What a datagram says (protocol/group_message.hpp), null where it says nothing that a group is for.
    void on_message(const group_source& from, const protocol::request_line* said, time_point now);

  private:
    bool serve(const group_source& from, const protocol::request_line& request, time_point now);
    bool on_bind(const group_source& from, const protocol::request_line& bind, time_point now);
    bool bind_noun(const group_source& from, const protocol::request_line& bind, time_point now);
    bool is_from_publisher(const group_source& from, const protocol::request_line& update, time_point now);
    bool on_update(const group_source& from, const protocol::request_line& update, time_point now);

    node& node_;
    group_source self_;
    group_bindings bindings_;
    group_welcomes welcomes_;
    group_feeds feeds_;
    publisher_sources sources_;
    group_presence* presence_ = nullptr;
};

} // namespace cles::core
