// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace cles::core {

/// How far a node is from the one that says so, by routes of which no two form a loop.
struct route_advert {
    std::uint64_t seq = 0;          ///< counts intervals of the destination: a greater one is newer
    std::optional<unsigned> hops{}; ///< links to the destination, 0 from itself; nothing: it cannot be reached

    bool operator==(const route_advert&) const = default;
};

/// The routes to nodes that this one has no link to, as its neighbours advertise them (docs/protocol.md, "Routes").
///
/// A distance-vector table without loops: each destination numbers its intervals, and a node uses a route only if it is
/// newer than all that the node has advertised itself, or as new and shorter (Perkins and Bhagwat: DSDV, SIGCOMM 1994;
/// the condition is that of Babel, RFC 8966, section 3.5.1). If no such route is left, requests take any other that a
/// neighbour advertises, but none to a node that has forwarded them, until the destination's next number has arrived.
class route_table {
  public:
    static constexpr unsigned max_hops = 16;      ///< as for the adverb `hops`
    static constexpr std::size_t max_offers = 16; ///< neighbours that count for one destination
    static constexpr std::uint64_t max_late = 4;  ///< intervals by which a route may be behind the newest

    /// Whether requests can be sent to that neighbour.
    using usable_function = std::function<bool(std::string_view neighbour)>;

    explicit route_table(std::size_t max_destinations) noexcept : max_destinations_(max_destinations) {}

    /// A route, as its neighbour advertises it.
    struct route {
        std::string by; ///< empty: there is none
        std::uint64_t seq = 0;
        unsigned hops = 0;

        bool operator==(const route&) const = default;
    };
    /// What an advertisement has changed.
    struct change {
        bool was_offered = false;    ///< by this neighbour
        route before{};              ///< in use
        route after{};               ///< the same
        std::uint64_t requested = 0; ///< the greatest number that was asked for
        std::uint64_t missing = 0;   ///< see `missing_number`
    };
    /// Applies what a neighbour advertises. Another epoch is another destination: what was known is forgotten.
    change apply(std::string_view name, std::uint32_t epoch, std::string_view neighbour, route_advert offered,
                 const usable_function& usable);
    /// The destinations that this neighbour advertises.
    [[nodiscard]] std::vector<std::string> destinations_by(std::string_view neighbour) const;
    void forget(std::string_view name);
    [[nodiscard]] std::vector<std::string> destinations() const;
    /// Those that advertise it.
    [[nodiscard]] std::vector<std::string> neighbours_of(std::string_view name) const;

    /// The route by which a request is sent: the shortest that does not lead through a node for which `avoid` is true;
    /// null: there is none. Valid until the next change.
    [[nodiscard]] const route* find_route(std::string_view name, const usable_function& usable,
                                          const std::function<bool(std::string_view)>& avoid = {}) const;
    /// What this node advertises to the neighbour `to`. `direct`: it has a link to the destination.
    route_advert advertise(std::string_view name, std::uint32_t epoch, bool direct, const usable_function& usable,
                           std::string_view to);
    /// Without a number of at least that, no route to the destination can be advertised again; 0: there is one, or
    /// none was ever advertised.
    [[nodiscard]] std::uint64_t missing_number(std::string_view name, const usable_function& usable) const;
    /// Remembers that this number is asked for. Returns whether that is new.
    bool request(std::string_view name, std::uint32_t epoch, std::uint64_t number);
    /// The greatest number that is known; 0: none.
    [[nodiscard]] std::uint64_t newest(std::string_view name) const;
    [[nodiscard]] std::size_t size() const noexcept { return epochs_.size(); }

  private:
    using offer = route;
    struct destination {
        std::string name{};
        std::uint64_t newest = 0;    ///< number that is known
        std::uint64_t requested = 0; ///< number that was asked for
        std::vector<offer> offers{};
        // The newest and shortest that was advertised: the feasibility distance.
        std::uint64_t seq = 0;
        unsigned hops = max_hops + 1;

        [[nodiscard]] bool is_feasible(const offer& o) const noexcept {
            return o.seq > seq || (o.seq == seq && o.hops < hops);
        }
        [[nodiscard]] bool is_current(const offer& o) const noexcept { return newest - o.seq < max_late; }
        void note_advertised(std::uint64_t s, unsigned h) noexcept;
        void take(std::string_view neighbour, route_advert offered);
    };

    static route copy_of(const offer* o) { return o == nullptr ? route{} : *o; }
    [[nodiscard]] std::uint64_t missing_number(const destination& d, const usable_function& usable) const;

    /// The route in use; null if there is none.
    [[nodiscard]] const offer* best(const destination& d, const usable_function& usable,
                                    const std::function<bool(std::string_view)>& avoid = {}) const;
    /// Null if it is unknown.
    [[nodiscard]] const destination* find(std::string_view name) const;
    [[nodiscard]] destination* find(std::string_view name, std::uint32_t epoch);
    destination& entry_of(std::string_view name, std::uint32_t epoch);

    std::size_t max_destinations_;
    std::map<std::string, std::uint32_t, std::less<>> epochs_; // by name
    // By epoch, because tables name them so: with a thousand nodes, most of the time is spent here.
    std::unordered_map<std::uint32_t, destination> destinations_;
};

} // namespace cles::core
