// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>
#include <cles/url.hpp>

#include "simulation/network/agenda.hpp"
#include "simulation/network/dice.hpp"
#include "simulation/network/place.hpp"
#include "simulation/network/planted.hpp"
#include "simulation/world/witness.hpp"

#include <chrono>
#include <compare>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::simulation {

class stream_half;
class datagram_port;
class group_port;

/// An address and port.
struct endpoint {
    unsigned host = 0;
    unsigned port = 0;

    auto operator<=>(const endpoint&) const = default;
};
std::string to_string(const endpoint& where);

/// A host's IPv4 address.
constexpr std::uint32_t address_of(unsigned host) noexcept { return 0x0A000001U + host; }

inline constexpr unsigned stream_listen_port = 1;   ///< the port on which nodes listen
inline constexpr unsigned datagram_listen_port = 1; ///< the same for datagrams

/// How a request travels.
enum class carrier : std::uint8_t {
    stream,
    datagram,
    urgent, ///< by a separate stream
    name,   ///< to the address that the node of that name announces
};
endpoint endpoint_of(const url& where);

/// The conditions of the network, per mille of datagrams.
struct weather {
    unsigned lost = 0;
    unsigned doubled = 0;
    unsigned late = 0; ///< much later than others, and so reordered
    std::chrono::microseconds least{100};
    std::chrono::microseconds spread{200};
};

/// The network between the hosts: carries streams and datagrams separately, and can be partitioned.
class network {
  public:
    network(agenda& time, witness& watcher, std::uint64_t seed, planted fault)
        : tampered(fault), time_(time), watcher_(watcher), seed_(seed), fault_(fault) {}
    network(const network&) = delete;
    network& operator=(const network&) = delete;

    void set(const weather& now) noexcept {
        weather_ = now;
        stormy_ = true;
    }
    /// Two hosts cannot reach each other: datagrams are lost, streams wait.
    void part(unsigned a, unsigned b, time_point until);
    /// Nothing that one host sends reaches the other; the opposite direction works.
    void mute(unsigned from, unsigned to, time_point until);
    /// Only these hosts are connected; the others refuse to be dialled.
    void connect_only(std::function<bool(unsigned a, unsigned b)> connected) { connected_ = std::move(connected); }
    /// What happens to a datagram on the way from one host to another: its additional delay; nothing: it is lost.
    using fate = std::function<std::optional<std::chrono::microseconds>(unsigned from, unsigned to)>;
    void impair(fate how) { fate_ = std::move(how); }
    /// Bytes of streams that have arrived anywhere, and those of routes in them.
    struct traffic {
        std::uint64_t all = 0;
        std::uint64_t routes = 0;
    };
    [[nodiscard]] const traffic& arrived() const noexcept { return arrived_; }
    /// `in_routes`: whether the stream's last bytes were part of routes.
    void count(std::string_view bytes, bool& in_routes) noexcept;
    /// All faults end.
    void calm();
    [[nodiscard]] bool reaches(unsigned from, unsigned to) const;
    /// Whether all hosts have reached each other without delay since then.
    [[nodiscard]] bool undisturbed_since(time_point when) const noexcept { return !stormy_ && disturbed_ <= when; }
    /// When stream data that is sent now arrives, unless earlier data delays it.
    time_point arrival(unsigned from, unsigned to);
    /// Each direction has separate random numbers, so that changes in one affect the others less.
    [[nodiscard]] dice& chance_between(unsigned from, unsigned to);
    [[nodiscard]] planted fault() const noexcept { return fault_; }
    /// Links are authenticated: nodes have security.
    void secure() noexcept { secured_ = true; }
    [[nodiscard]] bool secured() const noexcept { return secured_; }
    /// The URL on which the node of a host listens.
    [[nodiscard]] std::string url_of(unsigned host, carrier by) const;
    [[nodiscard]] witness& watcher() noexcept { return watcher_; }
    [[nodiscard]] agenda& time() noexcept { return time_; }
    /// An unused port of the host.
    unsigned free_port(unsigned host);

    using stream_ptr = std::shared_ptr<stream_half>;
    using on_link = std::function<void(stream_ptr)>;
    using on_dialled = std::function<void(boost::system::error_code, stream_ptr)>;
    void listen(endpoint where, const std::shared_ptr<place>& at, const limits& bounds, on_link arrived);
    /// Stops listening there.
    void shut(endpoint where) { doors_.erase(where); }
    /// `done` is called on the dialling host, later.
    void dial(const std::shared_ptr<place>& from, endpoint to, const limits& bounds, on_dialled done);
    /// Resets one of the streams of a host, if it has one.
    void cut(unsigned host, unsigned which);

    void open(const endpoint& where, const std::shared_ptr<datagram_port>& port) { ports_[where] = port; }
    void send(const endpoint& from, const endpoint& to, std::string_view datagram);
    void join(const std::shared_ptr<group_port>& port);
    /// To all members; each copy is lost, delayed or duplicated independently.
    void multicast(const endpoint& from, std::string_view datagram);
    /// Sees all datagrams as they are sent; `to` is nothing for the group.
    using eavesdropper = std::function<void(const endpoint& from, std::optional<endpoint> to, std::string_view)>;
    void eavesdrop(eavesdropper who) { eavesdropper_ = std::move(who); }
    /// A datagram of somebody else, who may state any source. It arrives soon, and once.
    void inject(const endpoint& from, std::optional<endpoint> to, std::string_view datagram);
    /// Stops listening on all ports of the host.
    void close_doors(unsigned host);

    /// The amount of traffic, as a measure of how much was simulated.
    [[nodiscard]] std::uint64_t datagrams() const noexcept { return datagrams_; }
    std::uint64_t stream_bytes = 0;
    tampering tampered; ///< what a planted fault does to streams

  private:
    struct door {
        std::weak_ptr<place> at;
        limits bounds;
        on_link arrived;
    };

    using delivery = std::function<void(const std::string& datagram, std::chrono::microseconds after, bool copy)>;
    void inspect(const endpoint& from, std::string_view datagram);
    void inspect_sealed(const endpoint& from, std::string_view datagram);
    void deliver_to_group(const std::weak_ptr<group_port>& member, const endpoint& from, const std::string& datagram,
                          std::chrono::microseconds after);
    void carry(unsigned from, unsigned to, dice& chance, std::string_view datagram, const delivery& deliver);
    void deliver(const endpoint& from, const endpoint& to, const std::string& datagram,
                 std::chrono::microseconds after);
    void join(const std::shared_ptr<place>& from, endpoint to, const limits& bounds, const on_dialled& done);

    agenda& time_;
    witness& watcher_;
    std::uint64_t seed_;
    std::map<std::pair<unsigned, unsigned>, dice> chances_;
    planted fault_;
    weather weather_;
    traffic arrived_;
    std::function<bool(unsigned a, unsigned b)> connected_; // empty: all are
    fate fate_;                                             // empty: only the weather counts
    bool stormy_ = false;
    bool secured_ = false;
    eavesdropper eavesdropper_;
    std::set<std::string, std::less<>> nonces_;                  // with which datagrams were sealed
    std::map<std::pair<unsigned, unsigned>, time_point> parted_; // from and to
    time_point disturbed_{};                                     // the end of the last disturbance
    std::map<endpoint, door> doors_;
    std::map<endpoint, std::weak_ptr<datagram_port>> ports_;
    std::vector<std::weak_ptr<group_port>> group_;
    std::vector<std::pair<std::weak_ptr<stream_half>, std::pair<unsigned, unsigned>>> streams_;
    std::uint64_t datagrams_ = 0;
};

} // namespace cles::simulation
