// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "federation/subject.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace cles::bridging {

/// What the bridge of a secured fleet asks about members. None of it calls the bridge.
class bridge_trust {
  public:
    bridge_trust() = default;
    bridge_trust(const bridge_trust&) = delete;
    bridge_trust& operator=(const bridge_trust&) = delete;

    /// Whether that member may forward for this node: others are no bridges to it.
    [[nodiscard]] virtual bool may_forward(std::string_view member) const = 0;
    /// How to permit it, for people.
    [[nodiscard]] virtual std::string how_to_permit(std::string_view member) const = 0;
    /// Why a BIND that this member has sent is refused. Nothing: it is permitted.
    [[nodiscard]] virtual std::optional<protocol::failure> refusal(std::string_view member,
                                                                   const protocol::request_line& bind) const = 0;
    [[nodiscard]] virtual std::uint32_t roster_version() const = 0;
    /// That bridge is lost. What it has sent before does not count any more.
    virtual void on_lost(const bridge_id& gone) = 0;
    /// A bridge has stated the version of its roster.
    virtual void on_stated_roster(const bridge_id& by, std::uint32_t version) = 0;
    /// A bridge has stated that it has sessions.
    virtual void on_stated_sessions(const bridge_id& by) = 0;

  protected:
    ~bridge_trust() = default;
};

} // namespace cles::bridging
