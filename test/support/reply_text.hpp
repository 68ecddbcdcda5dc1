// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include "protocol/reply_line.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace cles::test {

/// A parsed reply.
struct reply_parts {
    std::uint64_t id = 0;
    std::string error{}; ///< the code on the wire; empty for a success
    std::string message{};
    std::optional<std::uint64_t> retry_ms{};
    bool ran = false;
    std::string body{};
};

inline reply_parts read_reply(std::string_view line) {
    protocol::reply_line reply;
    reply_parts parts;
    if (!protocol::parse_reply(line, reply)) {
        parts.error = "malformed reply: " + std::string{line};
        return parts;
    }
    parts.id = reply.id;
    parts.body = reply.body;
    if (protocol::is_failure(reply.body)) {
        protocol::failure why;
        parts.error = protocol::parse_failure(reply.body, why) ? std::string{wire_name(why.code)}
                                                               : "no JSON: " + std::string{line};
        parts.message = why.message;
        parts.retry_ms = why.retry_ms;
        parts.ran = why.ran;
    }
    return parts;
}

/// "id=7 no_task", "busy", "id=7 ok": the kind of a reply, and its request. A line that is not a reply is returned
/// unchanged.
inline std::string kind_of(std::string_view line) {
    if (!protocol::is_reply(line)) {
        return std::string{line};
    }
    const auto parts = read_reply(line);
    const auto head = parts.id == 0 ? std::string{} : "id=" + std::to_string(parts.id) + " ";
    return head + (parts.error.empty() ? "ok" : parts.error);
}

} // namespace cles::test
