// SPDX-License-Identifier: BSL-1.0
// What it costs to choose a node for `any` among a hundred others and this one, which all offer the task. Prints the
// median in nanoseconds over some passes; fails if it is more than a microsecond.
#include "node/routing/load_balancer.hpp"
#include "node/routing/next_hop.hpp"
#include "node/routing/request_router.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace {

namespace core = cles::core;

struct system_time final : core::clock {
    [[nodiscard]] cles::time_point now() const override { return cles::time_point::clock::now(); }
};

/// Other nodes, which report what they offer, and receive no requests.
struct telling final : core::next_hop {
    std::uint64_t forward(const core::forwarding_permit&, const cles::protocol::outgoing_request&, cles::time_point,
                          cles::detail::pending_ptr, core::outbound::progress_function) override {
        return 0;
    }
    std::uint64_t send_own(const cles::protocol::outgoing_request& r, cles::time_point,
                           cles::detail::pending_ptr reply) override {
        asked.emplace_back(r.target(), std::move(reply));
        return asked.size();
    }
    void cancel(std::uint64_t) override {}
    std::shared_ptr<void> bind(const core::forwarding_permit&, std::string_view, core::feed_events&) override {
        return {};
    }
    void answer() {
        for (auto& [node, reply] : std::exchange(asked, {})) {
            reply.release()->offer(R"({"node":")" + node + R"(","tasks":[{"verb":"DELEGATE","task":"plan"}]})");
        }
    }
    std::vector<std::pair<std::string, cles::detail::pending_ptr>> asked;
};

constexpr int nodes = 100;
constexpr int choices = 100'000;
constexpr int passes = 9;

double pass(core::request_router& routing, const core::node_state& host) {
    cles::protocol::request_line request;
    cles::protocol::malformed_request wrong;
    cles::protocol::parse_request("DELEGATE any:plan id=7 {}", request, wrong);
    const auto begun = cles::time_point::clock::now();
    std::size_t here = 0;
    for (int i = 0; i < choices; ++i) {
        here += routing.choose(request, {}, {}, begun).here ? 1 : 0;
    }
    const std::chrono::duration<double, std::nano> took = cles::time_point::clock::now() - begun;
    if (here == 0 || here == choices) {
        std::fprintf(stderr, "%s was chosen %zu times of %d\n", host.name.c_str(), here, choices);
        return 1e9;
    }
    return took.count() / choices;
}

} // namespace

int main() {
    const system_time clock;
    const auto host = std::make_shared<core::node_state>(core::node_options{.name = "hub", .epoch = 1}, clock, [] {});
    host->tasks.add(cles::verb::delegate, "plan", {.plain = [](const cles::request&, cles::json_writer&) {}});
    telling others;
    const auto routing = std::make_shared<core::request_router>(host, others, 7, [] {});
    for (std::uint32_t i = 1; i <= nodes; ++i) {
        core::group_source from;
        from.address = 0x7f000001;
        from.port = static_cast<std::uint16_t>(i);
        host->peers.apply_announcement({.node = "car" + std::to_string(i),
                                        .endpoints = {"tcp://127.0.0.1:" + std::to_string(i)},
                                        .load = {.queued = i % 7, .running = i % 3, .workers = 4},
                                        .tasks = "same"},
                                       i, 1, from, clock.now());
        others.answer();
    }
    std::vector<double> times;
    times.reserve(passes);
    for (int i = 0; i < passes; ++i) {
        times.push_back(pass(*routing, *host));
    }
    std::sort(times.begin(), times.end());
    const auto median = times[times.size() / 2];
    std::printf("choice among %zu nodes: %.0f ns (median of %d passes of %d)\n",
                routing->offers(cles::verb::delegate, "plan").size() + 1, median, passes, choices);
    routing->stop();
    return median <= 1000 ? 0 : 1;
}
