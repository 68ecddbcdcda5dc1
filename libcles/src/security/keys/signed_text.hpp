// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include "security/keys/keys.hpp"

#include <cstdint>
#include <string>
#include <string_view>

/// What members sign: requests, updates and announcements (docs/protocol_security.md, "Signatures of members").

namespace cles::security {

struct signed_request {
    std::string_view requester{};
    std::string_view node{};      ///< the name of the executing node
    std::string_view challenge{}; ///< as that node wrote it
    verb kind = verb::pull;
    std::string_view noun{};    ///< task and parameters as nodes write them
    std::string_view body{};    ///< as sent; may be empty
    std::uint32_t waits_ms = 0; ///< how long the requester goes on waiting
    std::string_view bytes{};   ///< that follow the line; may be empty
};

struct signed_update {
    std::string_view publisher{};
    std::string_view noun{}; ///< task and parameters as nodes write them
    std::uint64_t seq = 0;
    std::string_view epoch{}; ///< as sent
    std::string_view body{};  ///< as sent; may be empty
};

/// 16 random bytes as text.
std::string new_challenge();
/// Whether the text is a challenge. A node signs no other one.
bool is_challenge(std::string_view text);

/// The noun of the reply that confirms an epoch. That of other announcements is `cles`.
std::string announced_noun(std::string_view challenge);

/// The text that is signed. \throws security_error if a part has a line end, the challenge is not one, or the node's
/// name is not a name
std::string text_to_sign(const public_key& fleet, const signed_request& request);
std::string text_to_sign(const public_key& fleet, const signed_update& update);

/// The value of `sig=`.
template <class Signed>
std::string sign(const signing_key& key, const public_key& fleet, const Signed& what) {
    return to_base64url(key.sign(text_to_sign(fleet, what)));
}

/// Whether `sig` is the value of `sig=` for this by the owner of the key.
template <class Signed>
bool verify(const public_key& by, const public_key& fleet, const Signed& what, std::string_view sig);

} // namespace cles::security
