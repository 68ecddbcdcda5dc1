// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/routing/other_pools.hpp"
#include "node/routing/request_router.hpp"
#include "support/recorded_next_hop.hpp"
#include "support/session_fixture.hpp"

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::test {

/// The node car1, which routes for a client on a link; the test plays the other nodes.
struct routing_fixture {
    routing_fixture() = default;
    /// Of a secured fleet, with a client that is a member.
    routing_fixture(std::shared_ptr<core::node_security> security, const std::string& client,
                    core::other_pools* pools = nullptr)
        : node(
              {}, {}, [this](log_level, const log_entry& entry) { logged.emplace_back(entry.text); }, {},
              std::move(security), nullptr, pools),
          link(node, client) {}
    routing_fixture(const routing_fixture&) = delete;
    routing_fixture& operator=(const routing_fixture&) = delete;
    ~routing_fixture() { routing->stop(); }

    /// Another node announces itself.
    void hear(const std::string& name, const std::string& digest = "d", node_load load = {}) {
        node.host->peers.apply_announcement(
            {.node = name, .endpoints = {"tcp://127.0.0.1:1"}, .load = load, .tasks = digest}, run_of(name),
            ++seq[name], from(name), node.clock.now());
    }
    void leave(const std::string& name) {
        node.host->peers.apply_announcement({.node = name, .leaving = true}, run_of(name), ++seq[name], from(name),
                                            node.clock.now());
    }
    static std::string description(const std::string& name, const std::string& tasks) {
        return R"({"node":")" + name + R"(","tasks":[)" + tasks + "]}";
    }
    static std::string task(const std::string& verb, const std::string& name, bool idempotent = false) {
        return R"({"verb":")" + verb + R"(","task":")" + name + (idempotent ? R"(","idempotent":true})" : "\"}");
    }
    /// Another node announces itself and its tasks, with a different digest.
    void offer(const std::string& name, const std::string& tasks, node_load load = {}) {
        hear(name, "of " + name, load);
        ways.to(name).answers(description(name, tasks));
    }

    static std::uint32_t run_of(const std::string& name) {
        return static_cast<std::uint32_t>(std::hash<std::string>{}(name));
    }
    static core::group_source from(const std::string& name) {
        core::group_source s;
        s.address = 0x7f000001;
        s.port = static_cast<std::uint16_t>(1000 + run_of(name) % 50000);
        return s;
    }

    /// What the service does when it is woken.
    void drain() {
        node.drain();
        core::send_updates(node.host->unsent_relayed, node.host->published, node.clock.now());
    }

    void have_turn() { routing->begin_ready(node.clock.now()); }

    std::vector<std::string> logged; ///< with security
    test_node node;
    recorded_next_hop ways;
    int wakes = 0;
    bool waits_for_turn = false; ///< scheduled requests start in `have_turn` instead of at once
    std::shared_ptr<core::request_router> routing = std::make_shared<core::request_router>(node.host, ways, 7, [this] {
        ++wakes;
        if (!waits_for_turn) {
            have_turn();
        }
    });
    test_link link{node};
    std::map<std::string, std::uint64_t> seq;
};

} // namespace cles::test
