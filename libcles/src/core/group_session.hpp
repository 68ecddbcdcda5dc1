// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/group_bindings.hpp"
#include "core/group_intake.hpp"
#include "core/group_output.hpp"
#include "core/group_welcomes.hpp"
#include "core/node.hpp"
#include "port/group_source.hpp"
#include "protocol/message.hpp"

#include <cstdint>
#include <memory>
#include <string_view>

namespace cles::core {

/// What a node makes of what it receives in its multicast group by one interface (docs/protocol.md, "Multicast"): BIND
/// of `all:` or of a node's name, which it serves by that interface, and updates, which are taken in by all of them
/// together. All else is dropped and counted, and nothing is ever answered there.
class group_session {
  public:
    /// `self`: where what this node sends by `out` comes from.
    group_session(const std::shared_ptr<node>& host, group_intake& intake, const group_source& self, group_output& out,
                  std::uint32_t seed)
        : node_(*host), intake_(intake), bindings_(*host, out, seed),
          welcomes_(host, [this](const group_source& from, const protocol::request_line& bind) {
              if (!bindings_.bind(from, bind, node_.time.now())) {
                  ++node_.counts.group_dropped;
              }
          }) {
        intake_.add_own(self);
    }

    /// What others are bound to here.
    [[nodiscard]] group_bindings& bindings() noexcept { return bindings_; }
    /// Nobody is bound any more, nor will be who has asked.
    void unbind_all() {
        welcomes_.clear();
        bindings_.clear();
    }

    /// What a datagram says (protocol/group_message.hpp), null where it says nothing that a group is for.
    void on_message(const group_source& from, const protocol::request_line* said, time_point now);

  private:
    bool serve(const group_source& from, const protocol::request_line& request, time_point now);
    bool on_bind(const group_source& from, const protocol::request_line& bind, time_point now);
    bool bind_noun(const group_source& from, const protocol::request_line& bind, time_point now);

    node& node_;
    group_intake& intake_;
    group_bindings bindings_;
    group_welcomes welcomes_;
};

} // namespace cles::core
