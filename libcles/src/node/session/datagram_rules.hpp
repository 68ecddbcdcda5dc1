// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/deadlines.hpp"
#include "node/base/string_map.hpp"
#include "protocol/request_line.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>
#include <utility>

/// What applies to datagrams only, which the network may lose, duplicate and reorder, and whose source may be forged
/// (docs/protocol.md, "UDP" and "Reflection").

namespace cles::core {

class line_sink;
struct node_state;
class reply_writer;

/// The memory in bytes that all sources of a node share for remembered requests.
struct dedup_memory {
    std::size_t limit;
    std::size_t used = 0;
};

/// The requests of one source (an address and port) that arrived by datagram, so that a repeat is recognised: while the
/// request runs, and for a minute after its reply, which a repeat receives again.
///
/// A request is identified by its id and all its bytes, so two different requests are never confused.
class dedup final : private deadline {
  public:
    static constexpr std::chrono::seconds memory{60};
    static constexpr std::size_t cost_of_entry = 192; ///< approximate, beyond the text

    dedup(deadline_queue& deadlines, dedup_memory& shared) noexcept : deadlines_(deadlines), shared_(shared) {}
    ~dedup();

    enum class verdict : std::uint8_t {
        fresh,    ///< unknown
        running,  ///< a repeat of a running request
        answered, ///< a repeat of an answered request: `reply` returns the reply
        clash,    ///< another request with this id is running
    };
    [[nodiscard]] verdict look(std::uint64_t id, std::string_view bytes) const;
    [[nodiscard]] std::string_view reply(std::uint64_t id, std::string_view bytes) const;

    /// Records a request that must not run twice. Returns false if there is no memory for it, or for a reply of
    /// `max_reply` bytes.
    bool begin(std::uint64_t id, std::string_view bytes, std::size_t max_reply);
    /// Records a request that may run again after it has been answered.
    void add_repeatable(std::uint64_t id, std::string_view bytes);
    /// The running request with this id, if any, has been answered with `reply` (empty if no reply was wanted).
    void set_reply(std::uint64_t id, std::string_view reply, time_point now);

    /// Whether nothing is remembered.
    [[nodiscard]] bool empty() const noexcept { return entries_.empty(); }

  private:
    struct entry {
        std::string text; // the request, followed by its reply
        std::size_t request = 0;
        std::size_t cost = 0;
        bool running = true;
        bool once = true;

        [[nodiscard]] std::string_view bytes() const noexcept { return std::string_view{text}.substr(0, request); }
    };
    using entries = std::multimap<std::uint64_t, entry>;
    struct done {
        entries::iterator which;
        time_point until;
    };

    [[nodiscard]] const entry* find(std::uint64_t id, std::string_view bytes) const;
    void enter(std::uint64_t id, std::string_view bytes, bool once, std::size_t cost);
    void charge(entry& e, std::size_t cost) noexcept;
    void forget(entries::iterator which) noexcept;
    void on_deadline(time_point now) override;

    deadline_queue& deadlines_;
    dedup_memory& shared_;
    entries entries_;
    std::deque<done> done_; // in order of expiry
};

/// Whether a request that has arrived by datagram is to be served: those that must not run twice need an id, and
/// repeats are recognised. False if it has been handled: refused, or recognised.
bool admit_datagram(const protocol::request_line& request, dedup& seen, node_state& host, line_sink& out,
                    reply_writer& replies);

/// Limits what a node sends to an unverified address to less than 64 KiB in any second, so that a forged source address
/// cannot be used to flood its owner.
///
/// An address is one host, whatever the port. Each has a bucket of 16 KiB that fills at 44 KiB a second. The rest is a
/// margin for the network, where datagrams may bunch up.
class reflection_limit {
  public:
    static constexpr std::size_t bytes_per_second = 44U * 1024U;
    static constexpr std::size_t at_once = 16U * 1024U;
    static constexpr std::size_t max_addresses = 16384;

    /// Whether a datagram of this size may be sent there; if so, it counts as sent.
    bool admit(std::string_view address, std::size_t bytes, time_point now);
    [[nodiscard]] std::size_t addresses() const noexcept { return buckets_.size(); }

  private:
    struct bucket {
        double tokens = static_cast<double>(at_once);
        time_point at{};

        void fill(time_point now) noexcept;
    };

    bucket* find_or_make(std::string_view address, time_point now);
    [[gnu::cold]] void forget_full(time_point now);

    string_map<bucket> buckets_;
    time_point tidied_{};
};

/// Limits what a node sends by datagram to one source: no update that is too large, and to an unverified address no
/// more than its share.
class datagram_output {
  public:
    /// `unverified_address`: the address whose share applies; empty if there is no limit.
    datagram_output(node_state& host, std::size_t longest, std::string unverified_address, std::size_t headers)
        : node_(host), max_datagram_(longest), unverified_address_(std::move(unverified_address)), headers_(headers) {}

    /// Appends updates except those that are too large, which the subscriber sees as gaps.
    void append_updates(std::string& out, std::string_view lines);
    /// Removes what an unverified address may not receive now. Call it once for everything that is appended.
    void limit(std::string& out, time_point now);

  private:
    node_state& node_;
    std::size_t max_datagram_;
    std::string unverified_address_;
    std::size_t headers_; // bytes that the network adds to each datagram
};

} // namespace cles::core
