// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/shared_reading.hpp>
#include <cles/verb.hpp>

#include "protocol/grammar.hpp"
#include "protocol/traceparent.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

/// Requests, in both directions: parsing and writing (docs/protocol.md).

namespace cles::protocol {

inline constexpr std::uint64_t max_deadline_ms = 86'400'000;
inline constexpr std::uint32_t default_deadline_ms = 5'000;
inline constexpr std::uint32_t default_delegate_deadline_ms = 30'000;
inline constexpr std::uint32_t default_keep = 64;
inline constexpr std::uint64_t max_keep = 65'536;
inline constexpr std::uint64_t max_hops = 16;
inline constexpr std::uint32_t default_hops = 8;
inline constexpr std::uint32_t default_lease_ms = 10'000;
inline constexpr std::uint32_t max_lease_ms = 60'000;
inline constexpr std::size_t max_since = 64;
inline constexpr std::size_t max_described = 64;
inline constexpr std::size_t max_sig = 128; // a signature has 86 characters

/// The adverb of a request for a member whose node it does not come from.
inline std::string adverb_from(std::string_view member) { return "from=" + std::string{member}; }

/// The value of `routes=8.car1` on `PULL self:cles/peers`.
struct routes_question {
    unsigned distance = 0; ///< of the nodes that are to ask for routes too, in links; 0: no routes are asked for
    std::string_view by{}; ///< the node that asks
};

constexpr std::uint32_t default_deadline(verb v) noexcept {
    return v == verb::delegate ? default_delegate_deadline_ms : default_deadline_ms;
}

/// The adverbs that go with a request wherever it goes: from the program that sends it to the line, from the line that
/// is parsed to the call that replies later, and through nodes that forward it. Code in between copies them as a whole.
struct carried_adverbs {
    bool urgent = false;
    trace_context trace{};

    bool operator==(const carried_adverbs&) const = default;
    /// These, of whatever has them.
    [[nodiscard]] const carried_adverbs& carried() const noexcept { return *this; }
};

/// A parsed request; absent adverbs have their defaults.
struct request_line : carried_adverbs {
    cles::verb verb = verb::pull;
    noun_view noun;
    std::uint64_t id = 0; ///< 0: none
    std::uint32_t deadline_ms = default_deadline_ms;
    bool wants_reply = true;
    bool wants_progress = false;
    std::uint8_t hops = default_hops;
    std::optional<std::uint32_t> lease_ms;
    std::uint32_t every_ms = 0; ///< 0: every update
    std::uint32_t keep = default_keep;
    bool wants_mark = false; ///< the reply to BIND is to name the update that it holds
    std::optional<std::uint64_t> seq;
    std::optional<std::uint32_t> epoch;
    std::string_view via;
    std::string_view from;  ///< the requester, if the peer forwards
    std::string_view sig;   ///< what the requester has signed it with, or an update's publisher
    std::string_view since; ///< what the requester knows already
    routes_question routes{};
    std::uint64_t grant = 0;                   ///< of slots, or on which a job is forwarded; 0: none
    std::size_t unknown_adverbs = 0;           ///< how many this version does not define for the verb
    std::string_view describe;                 ///< epochs of the incarnations to describe in full, separated by commas
    std::string_view body;                     ///< empty: none
    std::string_view text;                     ///< the whole line
    detail::shared_reading* reading = nullptr; ///< of the body, if others receive the same line

    /// An update, as opposed to a request to publish.
    [[nodiscard]] bool is_update() const noexcept { return seq && epoch; }
    [[nodiscard]] bool unbinds() const noexcept { return lease_ms == 0U; }
};

/// A line that is not a valid request, and what is known of the request that was meant.
struct malformed_request {
    std::string why;
    std::uint64_t id = 0;
    bool wants_reply = true;
};

/// Parses the parts of a request. The body is located but not validated, so that a caller that drops it does not pay
/// for it.
bool parse_request(std::string_view line, request_line& out, malformed_request& error);

/// The maximum size of a datagram, its LF included: small enough that no network fragments it.
inline constexpr std::size_t datagram_bytes = 1200;

/// Whether the text of a datagram, without its last LF, has more than one line.
constexpr bool has_many_lines(std::string_view text) noexcept { return text.find('\n') != std::string_view::npos; }

/// Parses a datagram of a multicast group, which holds one request. False if it is not valid: too long, of several
/// lines, a reply, or malformed. Views are into the datagram.
bool parse_group_message(std::string_view datagram, request_line& out);

/// Whether this version defines an adverb of that key for that verb.
bool is_known_adverb(std::string_view key, verb v) noexcept;

/// How many adverbs `append_request` writes at most for a request of that verb, besides `outgoing_request::adverbs`.
std::size_t max_written_adverbs(verb v) noexcept;

/// What the parts before the body contain for a reply to a malformed line.
[[gnu::cold]] malformed_request salvage(std::string_view line);

/// A request to send, whose text the sender owns. Zero or empty means: not written.
struct outgoing_request {
    cles::verb verb = verb::pull;
    std::string_view noun{};
    std::uint64_t id = 0;
    std::uint32_t deadline_ms = 0;
    bool wants_reply = true;
    bool wants_progress = false;
    carried_adverbs carried{};
    std::optional<std::uint32_t> lease_ms{};
    std::uint32_t every_ms = 0;
    std::uint32_t keep = 0;
    std::uint32_t hops = default_hops; ///< not written if it is the default
    bool wants_mark = false;
    std::string_view adverbs{}; ///< further ones, in wire format
    std::string_view body{};

    /// The node that the noun names.
    [[nodiscard]] std::string_view target() const noexcept { return noun.substr(0, noun.find(':')); }
    /// The size of its text, without the adverbs that have members.
    [[nodiscard]] std::size_t size() const noexcept { return noun.size() + adverbs.size() + body.size(); }
    /// Whether it is for the reserved task. Such requests keep a network together.
    [[nodiscard]] bool is_reserved() const noexcept { return noun.find(":cles") != std::string_view::npos; }
};

/// Copies the text of a request to `memory`, which must stay where it is. Returns the request with that text.
[[gnu::cold]] outgoing_request copy_text(const outgoing_request& request, std::string& memory);

/// Appends the request and its LF.
void append_request(std::string& out, const outgoing_request& request);

/// Appends an update's head: everything before its body.
void append_update_head(std::string& out, std::string_view publisher, std::string_view path, std::uint64_t seq,
                        std::string_view epoch);

/// Whether that is so of a name in `via`, the comma-separated list of the nodes that have forwarded a request.
template <class Condition>
constexpr bool any_in_via(std::string_view via, Condition is_so) {
    while (!via.empty()) {
        const auto comma = via.find(',');
        if (is_so(via.substr(0, comma))) {
            return true;
        }
        via.remove_prefix(comma == std::string_view::npos ? via.size() : comma + 1);
    }
    return false;
}

/// The last of these names.
constexpr std::string_view last_in_via(std::string_view via) noexcept {
    const auto comma = via.rfind(',');
    return comma == std::string_view::npos ? via : via.substr(comma + 1);
}

/// The value of `sig=` on a request that is not an update: `<signature>.<ms>`.
struct request_signature {
    std::string_view signature{};
    std::uint32_t waits_ms = 0; ///< how long the requester goes on waiting, when it signs
};
/// Nothing if the text has another form, such as that of version 1, which has no time.
std::optional<request_signature> parse_request_signature(std::string_view sig) noexcept;
std::string request_signature_text(const request_signature& sig);

/// Eight lower-case hex digits: parsing and formatting.
std::optional<std::uint32_t> parse_epoch(std::string_view text) noexcept;
std::string epoch_text(std::uint32_t epoch);
/// Sixteen such digits; not 0.
std::optional<std::uint64_t> parse_grant(std::string_view text) noexcept;
std::string grant_text(std::uint64_t grant);

/// A request that outlives the line from which it was parsed.
class owned_request {
  public:
    explicit owned_request(const protocol::request_line& r) : line_(r.text) {
        protocol::malformed_request ignored;
        protocol::parse_request(line_, parsed_, ignored); // was valid on arrival
        parsed_.trace = r.trace;                          // of this node's span
    }
    owned_request(const owned_request&) = delete;
    owned_request& operator=(const owned_request&) = delete;

    [[nodiscard]] const protocol::request_line& operator*() const noexcept { return parsed_; }
    [[nodiscard]] const protocol::request_line* operator->() const noexcept { return &parsed_; }

  private:
    std::string line_;
    protocol::request_line parsed_;
};

/// The head of a publisher's updates, of which only `seq` changes from one to the next: recognises the next one without
/// parsing it again, which halves the cost of reading a stream of updates.
class update_head {
  public:
    /// Remembers the head of this line, parsed to `update`, if it has the form that nodes write.
    void remember(std::string_view line, const request_line& update);
    /// The parsed line if its head is the remembered one except for the `seq`; else null. Valid until the next call.
    [[nodiscard]] const request_line* recognise(std::string_view line) noexcept;
    void forget() noexcept { before_.clear(); }

  private:
    std::string before_;                   // "UPDATE car1:localization seq="
    std::string after_;                    // " epoch=5f3a09c1 "
    std::string text_;                     // what `update_` points into
    std::unique_ptr<request_line> update_; // large, and most links receive no updates
};

} // namespace cles::protocol
