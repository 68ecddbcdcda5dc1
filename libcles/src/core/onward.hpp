// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/pending.hpp>
#include <cles/verb.hpp>

#include "core/outbound.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstdint>
#include <string>
#include <string_view>

namespace cles::core {

/// What is told of a noun that is bound on another node.
class feed_events {
  public:
    feed_events() = default;
    feed_events(const feed_events&) = delete;
    feed_events& operator=(const feed_events&) = delete;
    /// It is bound, for the first time or once more, with the noun's last value or {}.
    virtual void on_bound(std::string_view last) = 0;
    /// It could not be bound in the first place, and will not be: this is the last word.
    virtual void on_refused(const protocol::failure& why) = 0;
    /// An update, new and valid; its line as it came, with its body at the end.
    virtual void on_update(std::string_view line, std::string_view body) = 0;

  protected:
    ~feed_events() = default;
};

/// The ways to other nodes, as a router uses them.
class onward {
  public:
    onward() = default;
    onward(const onward&) = delete;
    onward& operator=(const onward&) = delete;

    struct request {
        cles::verb verb = verb::pull;
        std::string_view node;    ///< its name
        std::string_view path;    ///< the noun behind it, as it stands on the wire
        std::string_view adverbs; ///< further ones, likewise
        std::string_view body;
        bool urgent = false;
        time_point deadline{};
    };
    /// Sends a request. The operation never ends inside the call. Returns a number to withdraw it by.
    virtual std::uint64_t send(const request& r, detail::pending_ptr reply, outbound::progress_function progress) = 0;
    /// Withdraws a request that has not ended: its operation ends with `cancelled`, inside the call.
    virtual void withdraw(std::uint64_t ticket) = 0;

    /// Binds a noun of another node, and again when it is lost, until it is unbound. Nothing is told inside the call.
    /// Returns a number to unbind it by.
    virtual std::uint64_t bind(std::string_view node, std::string_view path, std::string_view adverbs,
                               feed_events& to) = 0;
    /// Nothing more is told.
    virtual void unbind(std::uint64_t ticket) = 0;

  protected:
    ~onward() = default;
};

/// The adverbs that a forwarded request bears beside those that the way itself writes: one `hops` less, this node's
/// name in `via`, and what this version does not know.
std::string onward_adverbs(const protocol::request_line& request, std::string_view own_name);

} // namespace cles::core
