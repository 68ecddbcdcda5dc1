// SPDX-License-Identifier: BSL-1.0
#include "simulation/network/network.hpp"

#include <cles/error.hpp>

#include "port/group_port.hpp"
#include "protocol/request_line.hpp"
#include "simulation/network/datagram_port.hpp"
#include "simulation/network/group_port.hpp"
#include "simulation/network/stream_half.hpp"

#include <algorithm>

namespace cles::simulation {
namespace {

constexpr std::chrono::microseconds much_later{400'000};
constexpr unsigned group_lane = 1U << 16U; // separate, so that traffic in the group does not affect other traffic

} // namespace

std::string to_string(const endpoint& where) {
    return to_text(
        core::group_source{.address = address_of(where.host), .port = static_cast<std::uint16_t>(where.port)});
}

endpoint endpoint_of(const url& where) {
    const auto read = core::parse_group_source(where.host + ":" + std::to_string(where.port)).value();
    return {read.address - address_of(0), read.port};
}

std::string network::url_of(unsigned host, carrier by) const {
    return by == carrier::datagram ? "udp://" + to_string(endpoint{host, datagram_listen_port})
                                   : (secured_ ? "tls://" : "tcp://") + to_string(endpoint{host, stream_listen_port});
}

// -- conditions ----------------------------------------------------------------------------------------------------

void network::part(unsigned a, unsigned b, time_point until) {
    mute(a, b, until);
    mute(b, a, until);
}

void network::mute(unsigned from, unsigned to, time_point until) {
    auto& held = parted_[{from, to}];
    held = std::max(held, until);
    disturbed_ = std::max(disturbed_, until);
}

// A marker that is split between two packets is missed.
void network::count(std::string_view bytes, bool& in_routes) noexcept {
    arrived_.all += bytes.size();
    while (!bytes.empty()) {
        constexpr std::string_view begin = "\"routes\":{";
        const auto end = in_routes ? bytes.find('}') : bytes.find(begin);
        const auto size = std::min(end, bytes.size());
        arrived_.routes += in_routes ? size : 0;
        bytes.remove_prefix(size);
        if (!bytes.empty()) {
            in_routes = !in_routes;
            bytes.remove_prefix(in_routes ? begin.size() : 1);
        }
    }
}

void network::calm() {
    weather_ = {};
    stormy_ = false;
    disturbed_ = time_.now();
    if (fault_ != planted::partition_stays) {
        parted_.clear();
    } else if (!parted_.empty()) {
        const auto [a, b] = parted_.begin()->first;
        part(a, b, time_point::max());
    }
}

bool network::reaches(unsigned from, unsigned to) const {
    const auto held = parted_.find({from, to});
    return held == parted_.end() || held->second <= time_.now();
}

dice& network::chance_between(unsigned from, unsigned to) {
    return chances_.try_emplace({from, to}, seed_ ^ (std::uint64_t{from} << 32U | to)).first->second;
}

time_point network::arrival(unsigned from, unsigned to) {
    auto& chance = chance_between(from, to);
    const auto way = weather_.least + chance.within(weather_.spread);
    const auto held = parted_.find({from, to});
    auto leaves = time_.now();
    if (held != parted_.end() && held->second > leaves) {
        if (held->second == time_point::max()) {
            return held->second;
        }
        leaves = held->second + chance.within(std::chrono::milliseconds{300}); // sent again then
    } else if (chance.chance(weather_.lost)) {
        leaves += std::chrono::milliseconds{200}; // sent again then
    }
    return leaves + way;
}

unsigned network::free_port(unsigned host) {
    for (unsigned port = 1000;; ++port) { // ports of an ended incarnation are assigned again
        const auto held = ports_.find({host, port});
        if (held == ports_.end() || held->second.expired()) {
            return port;
        }
    }
}

void network::close_doors(unsigned host) {
    doors_.erase({host, stream_listen_port});
    std::erase_if(ports_, [host](const auto& each) { return each.first.host == host; });
}

// -- streams -------------------------------------------------------------------------------------------------------

void network::listen(endpoint where, const std::shared_ptr<place>& at, const limits& bounds, on_link arrived) {
    doors_.insert_or_assign(where, door{at, bounds, std::move(arrived)});
}

void network::dial(const std::shared_ptr<place>& from, endpoint to, const limits& bounds, on_dialled done) {
    if (connected_ && !connected_(from->host(), to.host)) {
        from->later({}, [done = std::move(done)] { done(make_error_code(errc::unavailable), nullptr); });
        return;
    }
    if (!reaches(from->host(), to.host)) {
        from->later(bounds.connect, [done = std::move(done)] { done(make_error_code(errc::unavailable), nullptr); });
        return;
    }
    const auto there = arrival(from->host(), to.host);
    time_.at(there, if_alive(std::weak_ptr{from}, [this, to, bounds, done = std::move(done)](place& self) {
                 join(self.shared_from_this(), to, bounds, done);
             }));
}

void network::join(const std::shared_ptr<place>& from, endpoint to, const limits& bounds, const on_dialled& done) {
    const auto back = arrival(to.host, from->host());
    const auto found = doors_.find(to);
    const auto at = found == doors_.end() ? nullptr : found->second.at.lock();
    if (!at) {
        from->at_true(back, [done] { done(make_error_code(errc::unavailable), nullptr); });
        return;
    }
    const auto [near, far] = stream_half::make(*this, from, bounds, at, found->second.bounds);
    std::erase_if(streams_, [](const auto& each) { return each.first.expired(); });
    streams_.push_back({near, {from->host(), to.host}});
    at->run([arrived = found->second.arrived, far = far] { arrived(far); });
    const auto too_late = time_.now() + bounds.connect;
    from->at_true(std::min(back, too_late), [done, near = near, too_late, back] {
        if (!near->is_open() || back > too_late) {
            near->close();
            done(make_error_code(errc::unavailable), nullptr);
        } else {
            done({}, near);
        }
    });
}

void network::cut(unsigned host, unsigned which) {
    disturbed_ = std::max(disturbed_, time_.now());
    std::vector<std::shared_ptr<stream_half>> its;
    for (const auto& [weak, hosts] : streams_) {
        if (const auto half = weak.lock(); half && (hosts.first == host || hosts.second == host)) {
            its.push_back(half);
        }
    }
    if (!its.empty()) {
        its[which % its.size()]->cut();
    }
}

// -- datagrams -----------------------------------------------------------------------------------------------------

void network::send(const endpoint& from, const endpoint& to, std::string_view datagram) {
    inspect(from, datagram);
    if (eavesdropper_) {
        eavesdropper_(from, to, datagram);
    }
    carry(from.host, to.host, chance_between(from.host, to.host), datagram,
          [&](const std::string& bytes, std::chrono::microseconds after, bool copy) {
              auto source = from;
              if (copy && fault_ == planted::source_swapped) {
                  source.port += 500;
              }
              deliver(source, to, bytes, after);
          });
}

void network::join(const std::shared_ptr<group_port>& port) {
    std::erase_if(group_, [](const auto& each) { return each.expired(); });
    group_.push_back(port);
}

void network::multicast(const endpoint& from, std::string_view datagram) {
    inspect(from, datagram);
    if (eavesdropper_) {
        eavesdropper_(from, std::nullopt, datagram);
    }
    for (const auto& weak : group_) {
        const auto port = weak.lock();
        if (!port) {
            continue;
        }
        const auto to = port->local().host;
        carry(from.host, to, chance_between(from.host + group_lane, to), datagram,
              [&](const std::string& bytes, std::chrono::microseconds after, bool) {
                  deliver_to_group(weak, from, bytes, after);
              });
    }
}

void network::deliver_to_group(const std::weak_ptr<group_port>& member, const endpoint& from,
                               const std::string& datagram, std::chrono::microseconds after) {
    time_.later(after, if_alive(member, [from, datagram](group_port& there) { there.receive(from, datagram, true); }));
}

void network::inject(const endpoint& from, std::optional<endpoint> to, std::string_view datagram) {
    const std::string bytes{datagram};
    if (to) {
        deliver(from, *to, bytes, weather_.least);
        return;
    }
    for (const auto& member : group_) {
        deliver_to_group(member, from, bytes, weather_.least);
    }
}

// DATA: the member, the receiver's index and the counter; GROUP: the salt and the counter.
void network::inspect_sealed(const endpoint& from, std::string_view datagram) {
    constexpr std::size_t most = 1248;
    const auto kind = static_cast<unsigned char>(datagram.front());
    const std::size_t head = kind == 0x83 ? 20 : kind == 0x84 ? 32 : 0;
    if (datagram.size() > most || datagram.size() < head || kind < 0x81 || kind > 0x84) {
        watcher_.broken(rule::well_formed,
                        "a sealed datagram of " + std::to_string(datagram.size()) + " bytes from " + to_string(from));
    } else if (head != 0 && !nonces_.emplace(datagram.substr(head == 20 ? 0 : 8, head == 20 ? 20 : 24)).second) {
        watcher_.broken(rule::nonces_differ, to_string(from) + " seals two datagrams with the same nonce");
    }
}

void network::inspect(const endpoint& from, std::string_view datagram) {
    ++datagrams_;
    if (secured_) {
        inspect_sealed(from, datagram);
        return;
    }
    if (datagram.size() > protocol::datagram_bytes || !datagram.ends_with('\n') ||
        protocol::has_many_lines(datagram.substr(0, datagram.size() - 1))) {
        watcher_.broken(rule::well_formed, "a datagram of " + std::to_string(datagram.size()) + " bytes from " +
                                               to_string(from) + ": " + std::string{datagram.substr(0, 80)});
    }
}

void network::carry(unsigned from, unsigned to, dice& chance, std::string_view datagram, const delivery& deliver) {
    const auto more = fate_ ? fate_(from, to) : std::optional{std::chrono::microseconds{0}};
    if (!more || !reaches(from, to) || (connected_ && !connected_(from, to)) || chance.chance(weather_.lost)) {
        watcher_.saw("net", "loses", secured_ ? "a sealed datagram" : datagram);
        return;
    }
    std::string bytes{datagram};
    if (!secured_ && chance.chance(200)) { // its LF is optional
        bytes.pop_back();
    }
    const auto way = [&] {
        auto span = *more + weather_.least + chance.within(weather_.spread);
        if (chance.chance(weather_.late)) {
            span += chance.within(much_later);
        }
        return span;
    };
    deliver(bytes, way(), false);
    if (chance.chance(weather_.doubled)) {
        deliver(bytes, way(), true);
    }
}

void network::deliver(const endpoint& from, const endpoint& to, const std::string& datagram,
                      std::chrono::microseconds after) {
    constexpr char welcome = '\x82';
    if (fault_ == planted::welcome_late && datagram.starts_with(welcome)) {
        after += much_later;
    }
    time_.later(after, [this, from, to, datagram] {
        const auto found = ports_.find(to);
        if (const auto port = found == ports_.end() ? nullptr : found->second.lock()) {
            port->receive(from, datagram);
        } else if (secured_) { // the sources in the group have sessions, too
            for (const auto& weak : group_) {
                if (const auto member = weak.lock(); member && member->local() == to) {
                    member->receive(from, datagram, false);
                }
            }
        }
    });
}

} // namespace cles::simulation
