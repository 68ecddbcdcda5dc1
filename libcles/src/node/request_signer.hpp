// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/pending.hpp>
#include <cles/verb.hpp>

#include "port/environment.hpp"
#include "protocol/grammar.hpp"

#include <cstdint>
#include <map>
#include <string_view>
#include <vector>

namespace cles::core {

class local_node;

/// Signs the requests of this node that need it (docs/security.md, "Signed requests"): when a node has answered the
/// first attempt with a challenge, the request is sent to that node once more, with the signature.
class request_signer {
  public:
    /// \pre the node is secured
    explicit request_signer(local_node& host) noexcept : host_(host) {}
    request_signer(const request_signer&) = delete;
    request_signer& operator=(const request_signer&) = delete;

    /// A request that this node sends.
    struct outgoing {
        verb how = verb::pull;
        const protocol::noun_view& noun;
        std::string_view body{};
        const call_options& options;
        time_point deadline{};
        std::uint64_t ticket = 0; ///< the id of the first attempt
    };
    /// The operation for the first attempt, which completes `operation`, now or after the second attempt.
    [[nodiscard]] detail::pending_ptr watch(const outgoing& request, detail::pending_ptr operation);
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
