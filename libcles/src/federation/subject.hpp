// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include <compare>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

/// The subjects of NATS on which pools meet (docs/protocol.md, "Federation").

namespace cles::bridging {

inline constexpr std::size_t max_pool_name = 32;

/// 1 to 32 letters, digits, '_', '-'; not a target such as `any`.
bool is_pool_name(std::string_view text) noexcept;

/// A bridge, from the time when it has connected until it loses that connection.
struct bridge_id {
    std::string pool;
    std::string instance; ///< 16 lower-case hexadecimal digits, drawn at random

    auto operator<=>(const bridge_id&) const = default; // NOLINT(modernize-use-nullptr): not about pointers
};

bool is_instance(std::string_view text) noexcept;
std::string instance_text(std::uint64_t drawn);
/// Whether both are of one member of a secured fleet: its number is in the first 24 bits (core::message_seal).
bool are_of_one_member(std::string_view instance, std::string_view other) noexcept;

/// The group in which all bridges of a pool subscribe to its requests.
inline constexpr std::string_view queue_group = "cles";

std::string request_subject(std::string_view pool, verb how, std::string_view node, std::string_view task);
/// All requests of that verb.
std::string request_filter(std::string_view pool, verb how);
/// A request for that bridge, as a whole line.
std::string request_subject(const bridge_id& of);
std::string feed_subject(std::string_view pool, std::string_view node, std::string_view task);
std::string heartbeat_subject(const bridge_id& of);
std::string names_subject(const bridge_id& of);
std::string control_subject(const bridge_id& of);
std::string reply_subject(const bridge_id& of, std::uint64_t number);
/// Questions of sealed bridges to each other (docs/protocol_security.md, "Through NATS").
std::string question_subject(const bridge_id& of);
/// All messages for one bridge: its requests, replies, control, questions.
std::string inbox_filter(const bridge_id& of);
inline constexpr std::string_view heartbeat_filter = "cles.*.beat.*";
inline constexpr std::string_view names_filter = "cles.*.names.*";

enum class subject_kind : std::uint8_t { foreign, request, feed, heartbeat, names, control, reply, question };

/// The parts of a subject; which ones depends on its kind.
struct subject {
    subject_kind kind = subject_kind::foreign;
    std::string pool{};
    cles::verb verb = cles::verb::pull;
    std::string node{};
    std::string task{};
    std::string instance{}; ///< of a request: nothing if it is for any bridge of the pool
    std::uint64_t number = 0;

    [[nodiscard]] bridge_id bridge() const { return {pool, instance}; }
};

/// `foreign` if it is not one of these.
subject parse_subject(std::string_view text);

} // namespace cles::bridging
