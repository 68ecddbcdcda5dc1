// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/membership/membership.hpp"
#include "port/group_source.hpp"

#include <string_view>

namespace cles::simulation {

class node_run;

/// Who judges what nodes make of their multicast group.
class group_watch {
  public:
    group_watch() = default;
    group_watch(const group_watch&) = delete;
    group_watch& operator=(const group_watch&) = delete;
    /// A node is about to be handed a datagram of the group, or about to send one.
    virtual void on_group_heard(node_run& at, const core::group_source& from, std::string_view datagram) = 0;
    virtual void on_group_sent(node_run& by, std::string_view line) = 0;
    /// A node says that something about another one has changed.
    virtual void on_neighbour(node_run& at, std::string_view node, core::membership::change what) = 0;

  protected:
    ~group_watch() = default;
};

} // namespace cles::simulation
