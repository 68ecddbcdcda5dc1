// SPDX-License-Identifier: BSL-1.0
#include "security/sealed_network.hpp"

#include <algorithm>

namespace cles::security::test {

signing_key key_from(std::uint8_t seed) {
    secret_bytes bytes{32};
    std::ranges::fill(bytes.span(), seed);
    return signing_key{std::move(bytes)};
}

test_fleet::test_fleet(int cars) : authority(fleet_authority::found(key_from(200))) {
    std::vector<public_identity> members;
    for (int car = 1; car <= cars; ++car) {
        members.push_back({.name = name_of(car), .key = key_of(car).public_part()});
    }
    authority.add(members);
}

void test_fleet::add(int car) { authority.add({.name = name_of(car), .key = key_of(car).public_part()}); }

// -- a node --------------------------------------------------------------------------------------------------------

sealed_node::sealed_node(sealed_network& in, const test_fleet& of, int car, datagram_path where,
                         std::uint32_t own_epoch, datagram_limits limits)
    : network(in), at(where), number(static_cast<std::uint32_t>(car)), epoch(own_epoch), random(in.random()),
      fleet(test_fleet::name_of(car), test_fleet::key_of(car), of.authority.share()), group(fleet, random),
      group_in(fleet, group, random), sessions(fleet, *this, random, limits) {
    network.nodes_.push_back(this);
}

sealed_node::~sealed_node() { std::erase(network.nodes_, this); }

bool sealed_node::send(const sealed_node& to, std::string_view line) {
    return sessions.send(to.source(), line, network.now);
}

bool sealed_node::contact(const sealed_node& with) { return sessions.contact(with.source(), network.now); }

void sealed_node::receive(const datagram_path& from, bytes_view datagram) {
    sessions.receive(from, datagram, network.now);
}

std::vector<std::string> sealed_node::lines() const {
    std::vector<std::string> found;
    for (const auto& one : opened_log) {
        found.push_back(one.line);
    }
    return found;
}

std::size_t sealed_node::count(std::string_view line) const {
    return static_cast<std::size_t>(std::ranges::count(opened_log, line, &opened_line::line));
}

void sealed_node::send(const datagram_path& to, bytes_view datagram) {
    network.carry({.from = at, .to = to, .content = {datagram.begin(), datagram.end()}});
}

node_statement sealed_node::statement() {
    return {
        .roster = fleet.in_force().version(), .epoch = epoch, .salt = group.salt(), .counter = group.next_counter()};
}

void sealed_node::established(const datagram_source& with, const node_statement& stated, bool restarted) {
    group_in.learn(with.member, stated);
    established_log.push_back({with, stated, restarted});
}

void sealed_node::opened(const datagram_source& from, std::uint32_t peer_epoch, std::string_view line) {
    opened_log.push_back({from, peer_epoch, std::string{line}});
    if (on_opened) {
        on_opened(opened_line{opened_log.back()});
    }
}

// -- the network ---------------------------------------------------------------------------------------------------

void sealed_network::carry(datagram d) {
    sent.push_back(d);
    if (drop && drop(d)) {
        return;
    }
    std::uniform_real_distribution<double> chance{0, 1};
    const auto copies = chance(random) < with.repetition ? 2 : 1;
    for (int i = 0; i < copies; ++i) {
        if (chance(random) >= with.loss) {
            std::uniform_int_distribution<std::int64_t> delay{1, with.longest_delay.count()};
            under_way_.emplace(now + std::chrono::milliseconds{delay(random)}, d);
        }
    }
}

void sealed_network::run_until(time_point end) {
    for (;;) {
        auto next = under_way_.empty() ? time_point::max() : under_way_.begin()->first;
        sealed_node* timer = nullptr;
        for (auto* const node : nodes_) {
            if (const auto due = node->sessions.next_deadline(); due && *due < next) {
                next = *due;
                timer = node;
            }
        }
        if (next > end) {
            break;
        }
        now = std::max(now, next);
        if (timer != nullptr) {
            timer->sessions.on_time(now);
            continue;
        }
        const auto arrived = std::move(under_way_.extract(under_way_.begin()).mapped());
        for (auto* const node : std::vector{nodes_}) {
            if (node->at == arrived.to) {
                node->receive(arrived.from, arrived.content);
            }
        }
    }
    now = end;
}

std::size_t sealed_network::count(datagram_kind kind) const {
    return static_cast<std::size_t>(std::ranges::count_if(
        sent, [&](const auto& d) { return d.content.front() == static_cast<std::uint8_t>(kind); }));
}

} // namespace cles::security::test
