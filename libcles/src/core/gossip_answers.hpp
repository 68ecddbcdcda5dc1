// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>
#include <cles/limits.hpp>

#include "core/teller.hpp"

#include <cstddef>
#include <string_view>

namespace cles::core {

/// What is asked with `PULL self:cles/peers since=... describe=...`.
struct table_question {
    std::string_view since;
    std::string_view describe{}; ///< epochs, separated by commas
};

/// What a node that takes part in gossip answers to others who do (docs/protocol.md, "Gossip").
class gossip_answers {
  public:
    gossip_answers() = default;
    gossip_answers(const gossip_answers&) = delete;
    gossip_answers& operator=(const gossip_answers&) = delete;

    /// Writes what is new, in `longest` bytes at most with the head of the reply.
    virtual void write_news(json_writer& w, const table_question& asked, std::size_t longest, time_point now) = 0;
    /// Somebody tells, unasked. False where it is no table.
    virtual bool on_told(std::string_view json, const teller& by, time_point now) = 0;

  protected:
    ~gossip_answers() = default;
};

} // namespace cles::core
