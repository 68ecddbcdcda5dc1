// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/limits.hpp>
#include <cles/task_info.hpp>

#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

class reply_writer;

/// What is needed to forward a request later, besides its body.
struct movable_request {
    std::string path;      ///< of its noun
    std::string adverbs;   ///< as forwarded
    std::string via;       ///< the nodes that have forwarded it
    std::string requester; ///< in a secured fleet, whose rights apply
    std::size_t size = 0;  ///< of its line
};

/// What a node that shares work does with requests. An interface, so that a program that does not share does not link
/// it.
class request_sharing {
  public:
    request_sharing() = default;
    request_sharing(const request_sharing&) = delete;
    request_sharing& operator=(const request_sharing&) = delete;

    /// What is needed to forward the request; null if it is not moved to other nodes.
    [[nodiscard]] virtual std::unique_ptr<const movable_request> movable(const protocol::request_line& r,
                                                                         const identity& peer) = 0;
    /// Uses a slot of the grant on which the request for that task came. Returns why it cannot.
    [[nodiscard]] virtual std::optional<protocol::failure>
    use_grant(const protocol::request_line& r, const task_info& task, const identity& peer, time_point now) = 0;
    /// The adverb of a reply to that node with which it gets another slot; empty: it gets none.
    [[nodiscard]] virtual std::string grant_another(std::string_view to) = 0;
    /// Serves `PUSH self:cles/slots`.
    virtual void serve_slots(reply_writer& replies, const protocol::request_line& r, const identity& peer,
                             time_point now) = 0;

  protected:
    ~request_sharing() = default;
};

} // namespace cles::core
