// SPDX-License-Identifier: BSL-1.0
#include "core/refusals.hpp"

#include <utility>

namespace cles::core {

protocol::failure busy(std::string message) { return {.code = errc::busy, .message = std::move(message)}; }

protocol::failure no_memory(const node& n) {
    return busy(n.name + ": too much waits or runs for this link or all of them (limits.memory)");
}

protocol::failure no_such_task(const node& n, const protocol::request_line& r) {
    return {.code = errc::no_task,
            .message = n.name + " has no " + std::string{to_string(r.verb)} + " '" + std::string{r.noun.task} + "'"};
}

protocol::failure overlong(const node& n, std::size_t datagram) {
    if (datagram != 0) {
        return {.code = errc::too_large,
                .message = n.name + ": a datagram has at most " + std::to_string(datagram) + " bytes: use TCP"};
    }
    return {.code = errc::too_large,
            .message = n.name + ": a line has at most " + std::to_string(n.bounds.line) + " bytes"};
}

std::optional<protocol::failure> no_room_to_run(const node& n) {
    if (n.counts.handlers_running < n.bounds.running) {
        return std::nullopt;
    }
    return busy(n.name + " runs as many handlers as it may");
}

protocol::failure after_run(protocol::failure why) {
    why.ran = why.code == errc::too_large;
    return why;
}

std::string failure_text(const protocol::failure& why) {
    std::string text;
    protocol::append_failure(text, why);
    return text;
}

} // namespace cles::core
