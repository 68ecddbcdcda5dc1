// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "gateway/access/tokens.hpp"
#include "gateway/http/message.hpp"

#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

namespace gateway {

using time_point = std::chrono::steady_clock::time_point;

/// What a request has with it to say whose it is. Never in the URL, which logs and histories keep.
struct credentials {
    std::string token{};   ///< of `Authorization: Bearer`, or of the protocols of a WebSocket: cles.token.TOKEN
    std::string session{}; ///< of the cookie
};
credentials credentials_in(const http_request& request);
/// The value of `Set-Cookie` for a session; an empty one ends it. \param is_encrypted the browser uses TLS
std::string cookie_for(std::string_view session, bool is_encrypted);

/// Who asks, and how the gateway knows.
struct caller {
    std::string name{};    ///< of the token; empty: no tokens are needed
    std::string hash{};    ///< of the token
    std::string session{}; ///< if a cookie stands for the token
};

/// Decides who may use the gateway: whose token a request has with it, or which session stands for one. Sans-I/O.
class admission {
  public:
    static constexpr std::chrono::hours longest_session{12};
    static constexpr std::size_t most_sessions = 32; ///< of one token; beyond that, its oldest one ends

    /// \param hash_of the SHA-256 of a text, in hex digits
    admission(bool needs_token, std::function<std::string(std::string_view)> hash_of)
        : needs_token_(needs_token), hash_of_(std::move(hash_of)) {}

    void set_tokens(token_table tokens) { tokens_ = std::move(tokens); }
    [[nodiscard]] std::variant<caller, refusal> admit(const credentials& shown, time_point now) const;
    /// Whether that is still so, which is asked before each update. A token may have been taken from the file, and a
    /// session may have ended.
    [[nodiscard]] bool is_admitted(const caller& who, time_point now) const;
    /// Lets a session stand for the token. \param id random, and long enough that nobody guesses it
    void open_session(const caller& who, std::string id, time_point now);
    /// Ends a session of the caller's token; another one's stays.
    void close_session(const caller& who, const std::string& id);

  private:
    struct session {
        std::string hash;
        time_point ends;
    };

    bool needs_token_;
    std::function<std::string(std::string_view)> hash_of_;
    token_table tokens_{};
    std::map<std::string, session> sessions_;
};

} // namespace gateway
