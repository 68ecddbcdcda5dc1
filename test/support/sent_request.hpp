// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/session/outbound.hpp"
#include "support/recorded_reply.hpp"
#include "support/session_fixture.hpp"

#include <chrono>
#include <memory>
#include <utility>

namespace cles::test {

/// Sends a request to the peer of a link, and records its outcome.
inline std::shared_ptr<outcome> send_on(test_link& link, const test_node& node,
                                        const protocol::outgoing_request& request,
                                        std::chrono::milliseconds limit = std::chrono::seconds{5},
                                        core::outbound::progress_function progress = {}) {
    auto [operation, result] = record();
    const auto now = node.clock.now();
    link.session().asking().send(request, now + limit, now, std::move(operation), std::move(progress));
    return result;
}

} // namespace cles::test
