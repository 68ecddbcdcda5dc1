// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>

/// How much of what one node tells is used. A node may tell anything, up to the length of a line (8 MiB). So whatever
/// reads it asks here before it makes anything of a part: what is longer, or more, is left out.
namespace gateway::told_limits {

// Bytes.
inline constexpr std::size_t reply = 1U << 20U;  ///< where each node is asked on its own
inline constexpr std::size_t node = 129;         ///< POOL.NODE
inline constexpr std::size_t path = 128;         ///< of a metric
inline constexpr std::size_t number = 32;        ///< as it is written
inline constexpr std::size_t digest = 64;        ///< of types
inline constexpr std::size_t parameter = 64;     ///< its name
inline constexpr std::size_t description = 1024; ///< of a task
inline constexpr std::size_t text_of_span = 256; ///< a verb, a name, an outcome

// How many.
inline constexpr std::size_t values = 1024; ///< metrics
inline constexpr std::size_t tasks = 1024;
inline constexpr std::size_t spans = 256; ///< of a trace

} // namespace gateway::told_limits
