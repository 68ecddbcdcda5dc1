// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/agenda.hpp"

#include <boost/describe/enum.hpp>
#include <boost/describe/enum_to_string.hpp>

#include <cstdint>
#include <cstring>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::simulation {

/// The invariants (README.md of the folder above).
BOOST_DEFINE_FIXED_ENUM_CLASS(rule, std::uint8_t,
                              effects_once,  ///< PUSH, DELEGATE and UPDATE run at most once
                              ends_in_time,  ///< every request completes once, by its deadline
                              reply_order,   ///< requests without id are answered in their order
                              update_order,  ///< a feed receives each update at most once, in order, as published
                              gaps_told,     ///< a feed's updates and reported gaps together are everything published
                              replies_match, ///< a reply belongs to its request, and is true
                              well_formed,   ///< every message on the network is valid and within its size
                              bounded,       ///< memory stays within the limits
                              at_rest,       ///< nothing is kept without activity
                              asks_succeed,  ///< after the faults have ended, requests succeed
                              feeds_receive, ///< after the faults have ended, feeds are bound and receive
                              backs_off,     ///< a lost feed pauses before it binds again
                              others_known,  ///< after the faults have ended, each node knows exactly the running nodes
                              names_awaited, ///< a node that has just started waits for names that it does not know yet
                              nobody_lost,   ///< a node received lately is not considered silent, gone, or another one
                              gone_in_time,  ///< a silent node is suspect and gone in time; one that leaves, at once
                              clashes_told,  ///< a second live node of a name is reported, and does not get the name
                              authentic,     ///< with security, only what a member has sent is delivered, and once
                              removed_unserved, ///< nobody is served who is not in the roster
                              rights_hold,      ///< nobody is served, or sent an update, without the right to it
                              rosters_spread,   ///< after the faults have ended, all nodes soon have the newest roster
                              rosters_advance,  ///< a node never returns to an older roster
                              back_soon,        ///< a node that has restarted is soon asked and received again
                              nonces_differ,    ///< no two datagrams are sealed with the same nonce and key
                              routes_found,     ///< after the faults have ended, all routes are the shortest
                              links_kept,       ///< no link is opened that a node's `links` forbid
                              sent_once,   ///< the group gets each update once, and again only for a new subscriber
                              first_soon,  ///< a new subscriber in the group soon receives the last update
                              same_trace); ///< a seed always produces the same trace

inline std::string_view to_string(rule r) noexcept { return boost::describe::enum_to_string(r, ""); }

/// A violation of a rule.
struct violation {
    rule broken;
    std::string what;
};

/// Receives all events: keeps their hash, passes them to a reader, and records violations.
class witness {
  public:
    using reader = std::function<void(const std::string&)>;

    explicit witness(const agenda& time) : time_(time) {}

    void read_by(reader who) { reader_ = std::move(who); }
    /// An event that belongs to the trace.
    void saw(std::string_view who, std::string_view what, std::string_view text = {}) {
        mix(static_cast<std::uint64_t>(time_.now().time_since_epoch().count()));
        mix(who);
        mix(what);
        mix(text);
        if (reader_) {
            tell(who, what, text);
        }
    }
    void broken(rule which, std::string what) {
        saw("!", to_string(which), what);
        constexpr std::size_t enough = 64;
        if (violations_.size() < enough) {
            violations_.push_back({which, std::move(what)});
        }
    }

    [[nodiscard]] std::uint64_t hash() const noexcept { return hash_; }
    [[nodiscard]] const std::vector<violation>& violations() const noexcept { return violations_; }

  private:
    void mix(std::uint64_t value) noexcept {
        hash_ = (hash_ ^ value) * 0x100000001b3U; // FNV-1a, eight bytes at a time
        hash_ ^= hash_ >> 29U;
    }
    void mix(std::string_view text) noexcept {
        mix(text.size());
        while (!text.empty()) {
            std::uint64_t eight = 0;
            const auto size = std::min<std::size_t>(8, text.size());
            std::memcpy(&eight, text.data(), size);
            mix(eight);
            text.remove_prefix(size);
        }
    }
    void tell(std::string_view who, std::string_view what, std::string_view text) const {
        const auto us = std::chrono::duration_cast<std::chrono::microseconds>(time_.now().time_since_epoch()).count() -
                        3'600'000'000;
        auto at = std::to_string(us % 1'000'000);
        at.insert(0, 6 - at.size(), '0');
        std::string line = std::to_string(us / 1'000'000) + "." + at + " ";
        line.append(who).append(" ").append(what);
        if (!text.empty()) {
            line.append(" ").append(text.substr(0, text.find_last_not_of('\n') + 1));
        }
        reader_(line);
    }

    const agenda& time_;
    std::uint64_t hash_ = 0xcbf29ce484222325U;
    std::vector<violation> violations_;
    reader reader_;
};

} // namespace cles::simulation
