// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/boottime_clock.hpp>
#include <cles/identity.hpp>

#include "port/environment.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <list>
#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

struct node_state;

/// The challenges that this node has given to requesters of signed tasks (docs/protocol_security.md, "Signed
/// requests"). Each is valid once, for the same request, until its first attempt's deadline, but no longer than
/// requests of its verb usually wait, or until the end of the link on which it was given.
class request_challenges {
  public:
    /// Beyond these, the oldest one is forgotten.
    static constexpr std::size_t max_per_link = 64;
    static constexpr std::size_t max_in_all = 1024;

    /// \pre the node is secured
    explicit request_challenges(const node_state& host) noexcept : node_(host) {}

    /// Why a request for a signed task may not run: it has no signature, and the failure contains a challenge, or its
    /// signature is not valid. Nothing if it may run, once: then `due` becomes the time until which its requester has
    /// signed to wait, if that is earlier. `link` is the identity of the peer, of which each link has its own.
    [[nodiscard]] std::optional<protocol::failure> refusal(const identity& link, const protocol::request_line& request,
                                                           time_point& due, time_point now);
    /// The link is gone.
    void forget(const identity& link) noexcept;
    [[nodiscard]] std::size_t size() const noexcept { return given_.size(); }

  private:
    struct request_key {
        const identity* link = nullptr;
        std::string requester{};
        verb how = verb::pull;
        std::string path{};
        std::size_t body = 0; // its hash; the signature covers the body itself

        bool operator==(const request_key&) const = default;
        [[nodiscard]] bool is_same_request(const request_key& other) const;
    };
    struct given {
        request_key what;
        std::string challenge;
        time_point issued;
        time_point due;
    };

    [[nodiscard]] request_key key_of(const identity& link, const protocol::request_line& request) const;
    [[nodiscard]] protocol::failure not_accepted(std::string_view task, std::string_view why) const;
    [[nodiscard]] protocol::failure challenge(request_key what, std::string_view task, time_point due, time_point now);
    void make_space(const identity* link, time_point now);

    const node_state& node_;
    std::list<given> given_; // oldest first
};

} // namespace cles::core
