// SPDX-License-Identifier: BSL-1.0
#include "gateway/access/admission.hpp"

namespace gateway {
namespace {

constexpr std::string_view session_cookie = "cles_session";
constexpr std::string_view token_protocol = "cles.token.";

refusal unauthorised(std::string message) {
    return {.status = 401, .message = std::move(message), .fields = {{"WWW-Authenticate", "Bearer"}}};
}

} // namespace

credentials credentials_in(const http_request& request) {
    credentials found;
    auto authorization = request.field("authorization");
    if (small_letters(take_part(authorization, ' ')) == "bearer") {
        found.token = trimmed(authorization);
    }
    for (auto protocols = request.field("sec-websocket-protocol"); !protocols.empty() && found.token.empty();) {
        if (const auto part = take_part(protocols, ','); part.starts_with(token_protocol)) {
            found.token = part.substr(token_protocol.size());
        }
    }
    for (auto cookies = request.field("cookie"); !cookies.empty() && found.session.empty();) {
        auto value = take_part(cookies, ';');
        if (take_part(value, '=') == session_cookie) {
            found.session = value;
        }
    }
    return found;
}

std::string cookie_for(std::string_view session, bool is_encrypted) {
    std::string out{session_cookie};
    out.append("=").append(session).append("; Path=/; HttpOnly; SameSite=Strict");
    return out.append(is_encrypted ? "; Secure" : "").append(session.empty() ? "; Max-Age=0" : "");
}

std::variant<caller, refusal> admission::admit(const credentials& shown, time_point now) const {
    if (!needs_token_) {
        return caller{};
    }
    caller found{.name = {}, .hash = shown.token.empty() ? std::string{} : hash_of_(shown.token), .session = {}};
    if (shown.token.empty() && !shown.session.empty()) {
        const auto known = sessions_.find(shown.session);
        if (known == sessions_.end()) {
            return unauthorised("the session has ended");
        }
        found.hash = known->second.hash;
        found.session = shown.session;
    }
    found.name = tokens_.name_of(found.hash);
    if (found.hash.empty()) {
        return unauthorised("a token is needed: send Authorization: Bearer TOKEN");
    }
    if (!is_admitted(found, now)) {
        return unauthorised(found.session.empty() ? "the token is not known here" : "the session has ended");
    }
    return found;
}

bool admission::is_admitted(const caller& who, time_point now) const {
    if (!needs_token_) {
        return true;
    }
    if (who.name.empty() || tokens_.name_of(who.hash) != who.name) {
        return false;
    }
    const auto found = sessions_.find(who.session);
    return who.session.empty() || (found != sessions_.end() && found->second.ends > now);
}

void admission::open_session(const caller& who, std::string id, time_point now) {
    std::erase_if(sessions_, [now](const auto& each) { return each.second.ends <= now; });
    std::size_t others = 0;
    auto oldest = sessions_.end();
    for (auto at = sessions_.begin(); at != sessions_.end(); ++at) {
        if (at->second.hash == who.hash) {
            ++others;
            oldest = oldest == sessions_.end() || at->second.ends < oldest->second.ends ? at : oldest;
        }
    }
    if (others >= most_sessions) {
        sessions_.erase(oldest);
    }
    sessions_.insert_or_assign(std::move(id), session{.hash = who.hash, .ends = now + longest_session});
}

void admission::close_session(const caller& who, const std::string& id) {
    if (const auto found = sessions_.find(id); found != sessions_.end() && found->second.hash == who.hash) {
        sessions_.erase(found);
    }
}

} // namespace gateway
