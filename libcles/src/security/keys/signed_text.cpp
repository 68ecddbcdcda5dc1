// SPDX-License-Identifier: BSL-1.0
#include "security/keys/signed_text.hpp"

#include "protocol/grammar.hpp"

#include <algorithm>
#include <array>
#include <initializer_list>

#include <sodium.h>

namespace cles::security {
namespace {

using challenge_bytes = std::array<std::uint8_t, 16>;

// A part with a line end would give the text a second reading.
bool has_line_end(std::initializer_list<std::string_view> parts) {
    return std::ranges::any_of(parts, [](auto part) { return part.find('\n') != std::string_view::npos; });
}

std::string join_lines(std::initializer_list<std::string_view> lines) {
    std::string text;
    for (const auto line : lines) {
        text.append(line).push_back('\n');
    }
    return text;
}

// The SHA-256 in hex; empty without bytes.
std::string digest_line(std::string_view bytes) {
    if (bytes.empty()) {
        return {};
    }
    std::array<std::uint8_t, crypto_hash_sha256_BYTES> digest{};
    crypto_hash_sha256(digest.data(), as_bytes(bytes).data(), bytes.size());
    std::array<char, 2 * digest.size() + 1> text{}; // with its end
    return sodium_bin2hex(text.data(), text.size(), digest.data(), digest.size());
}

std::string_view body_or_default(std::string_view body) { return body.empty() ? std::string_view{"{}"} : body; }

} // namespace

std::string new_challenge() {
    const auto drawn = secret_bytes::random(challenge_bytes{}.size());
    return to_base64url(drawn.view());
}

bool is_challenge(std::string_view text) {
    challenge_bytes bytes{};
    return read_base64url(text, bytes);
}

std::string announced_noun(std::string_view challenge) { return std::string{"cles/announced/"}.append(challenge); }

std::string text_to_sign(const public_key& fleet, const signed_request& request) {
    if (!protocol::is_name(request.node)) {
        throw security_error{protocol::quoted(request.node) + " is not a name of a node"};
    }
    if (!is_challenge(request.challenge)) {
        throw security_error{protocol::quoted(request.challenge) + " is not a challenge"};
    }
    if (has_line_end({request.requester, request.noun, request.body})) {
        throw security_error{"what is signed contains a line end"};
    }
    const auto action = std::string{to_string(request.kind)}.append(" ").append(request.noun);
    return join_lines({"cles request 2", to_base64url(fleet), request.requester, request.node, request.challenge,
                       action, body_or_default(request.body), std::to_string(request.waits_ms),
                       digest_line(request.bytes)});
}

std::string text_to_sign(const public_key& fleet, const signed_update& update) {
    if (has_line_end({update.publisher, update.noun, update.epoch, update.body})) {
        throw security_error{"what is signed contains a line end"};
    }
    const auto position = std::to_string(update.seq).append(" ").append(update.epoch);
    return join_lines(
        {"cles update 1", to_base64url(fleet), update.publisher, update.noun, position, body_or_default(update.body)});
}

template <class Signed>
bool verify(const public_key& by, const public_key& fleet, const Signed& what, std::string_view sig) {
    signature made{};
    if (!read_base64url(sig, made)) {
        return false;
    }
    try {
        return verify(by, text_to_sign(fleet, what), made);
    } catch (const security_error&) { // nobody signs such a text
        return false;
    }
}
template bool verify(const public_key&, const public_key&, const signed_request&, std::string_view);
template bool verify(const public_key&, const public_key&, const signed_update&, std::string_view);

} // namespace cles::security
