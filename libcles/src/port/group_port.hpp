// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/group_source.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <string_view>

namespace cles::core {

/// A datagram from a multicast group, parsed once for all nodes that receive it; valid for the call.
struct group_datagram {
    const group_source& from;
    std::string_view text;
    const protocol::request_line* request; ///< null: nothing that a group is for
};

/// What comes from a multicast group.
class group_listener {
  public:
    group_listener() = default;
    group_listener(const group_listener&) = delete;
    group_listener& operator=(const group_listener&) = delete;
    /// A node's own datagrams too, where others listen at the same socket.
    virtual void on_datagram(const group_datagram& datagram) = 0;
    /// All that had arrived has been handed over.
    virtual void on_batch() = 0;
    /// What had to wait has been sent.
    virtual void on_room() = 0;

  protected:
    ~group_listener() = default;
};

/// How much of some lines needs no more care: it was sent, or waits to be.
struct lines_done {
    std::size_t lines = 0;
    std::size_t bytes = 0;
};

/// A node's place in a multicast group, by one interface: receives the group, and sends from an address and port that
/// are this node's for as long as it runs.
class group_port {
  public:
    group_port() = default;
    group_port(const group_port&) = delete;
    group_port& operator=(const group_port&) = delete;
    virtual ~group_port() = default;

    /// Begins to hand over what arrives. The listener stays until `close`.
    virtual void start(group_listener& owner) = 0;
    /// Sends whole lines, each with its LF as one datagram; what finds no room waits for it. A datagram that cannot be
    /// sent for another reason counts as lost on its way.
    /// \return less than all where as much waits as may
    virtual lines_done send(std::string_view lines) = 0;
    /// Bytes that wait for room.
    [[nodiscard]] virtual std::size_t unsent() const noexcept = 0;
    virtual void close() = 0;
    /// Where what this node sends comes from.
    [[nodiscard]] virtual const group_source& source() const noexcept = 0;
};

} // namespace cles::core
