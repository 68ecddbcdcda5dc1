// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>

namespace cles {

/// Identifies an update of a noun: its sequence number, and the publisher's run (docs/protocol.md, "Updates").
struct update_mark {
    std::uint64_t seq = 0;
    std::uint32_t epoch = 0;

    bool operator==(const update_mark&) const = default;
};

} // namespace cles
