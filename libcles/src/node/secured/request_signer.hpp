// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include "node/security_protocol.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

namespace cles::core {

class local_node;

/// Signs the requests of this node that need it (docs/protocol_security.md, "Signed requests"): when a node has
/// answered the first attempt with a challenge, the request is sent to that node once more, with the signature.
class request_signer : public std::enable_shared_from_this<request_signer> {
  public:
    explicit request_signer(local_node& host) noexcept : host_(host) {}
    request_signer(const request_signer&) = delete;
    request_signer& operator=(const request_signer&) = delete;

    /// The operation for the first attempt, which completes `operation`, now or after the second attempt.
    [[nodiscard]] detail::pending_ptr watch(const outgoing_call& request, detail::pending_ptr operation);
    /// Cancels the second attempt of a request. Returns false if there is none.
    bool cancel(std::uint64_t ticket);

    // For the attempts.
    void note(std::uint64_t ticket, std::uint64_t id) { repeated_[ticket].push_back(id); }
    void forget(std::uint64_t ticket) { repeated_.erase(ticket); }

  private:
    local_node& host_;
    std::map<std::uint64_t, std::vector<std::uint64_t>> repeated_; // the ids of second attempts, by ticket
};

} // namespace cles::core
