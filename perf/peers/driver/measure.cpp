// SPDX-License-Identifier: BSL-1.0
#include "figures.hpp"
#include "perf/support/clock.hpp"
#include "perf/support/pinning.hpp"

#include <algorithm>
#include <chrono>
#include <memory>
#include <string_view>
#include <vector>

#include <sched.h>
#include <unistd.h>

namespace cles::perf::peers {
namespace {

using clock = std::chrono::steady_clock;

constexpr std::string_view no_offer = "not offered: ";

void run_on(const std::vector<int>& cores) {
    cpu_set_t allowed;
    CPU_ZERO(&allowed);
    for (const auto core : cores) {
        CPU_SET(static_cast<std::size_t>(core), &allowed);
    }
    checked(::sched_setaffinity(0, sizeof allowed, &allowed), "sched_setaffinity");
}

double microseconds(std::chrono::nanoseconds time) { return static_cast<double>(time.count()) / 1e3; }

/// The processes of a measurement.
class process_group {
  public:
    process_group(pid_t server, pid_t broker) : members_{{"client", ::getpid()}, {"server", server}} {
        if (broker > 0) {
            members_.emplace("broker", broker);
        }
    }

    [[nodiscard]] std::chrono::nanoseconds cpu() const {
        std::chrono::nanoseconds sum{};
        for (const auto& [role, id] : members_) {
            sum += cpu_used(id);
        }
        return sum;
    }

    [[nodiscard]] std::map<std::string, footprint> footprints() const {
        std::map<std::string, footprint> all;
        for (const auto& [role, id] : members_) {
            all.emplace(role, footprint_of(id));
        }
        if (const auto broker = all.find("broker"); broker != all.end()) {
            broker->second.libraries.clear(); // its memory counts, but a node does not need its libraries
        }
        return all;
    }

  private:
    std::map<std::string, pid_t> members_;
};

figures measure_calls(peer& with, call what, const std::string& where, const options& how, const process_group& all) {
    const auto caller = with.call_at(what, where);
    latency_recorder warm_up{std::max<std::size_t>(how.count / 10, 2 * std::size_t{how.in_flight})};
    caller->ask(how.in_flight, warm_up);
    latency_recorder record{how.count};
    const auto cpu_before = all.cpu();
    const auto began = clock::now();
    caller->ask(how.in_flight, record);
    const std::chrono::duration<double> took = clock::now() - began;
    const auto cpu = all.cpu() - cpu_before;
    figures found{.count = record.count(),
                  .latency = record.quantiles(),
                  .per_second = static_cast<double>(record.count()) / took.count(),
                  .cpu_us = microseconds(cpu) / static_cast<double>(record.count())};
    found.footprints = all.footprints();
    return found;
}

figures measure_fan_out(peer& with, const std::string& where, const options& how, const process_group& all) {
    const auto binders = with.subscribe(where, how.subscribers);
    fan_out_order order{.binders = how.subscribers,
                        .updates = std::max<std::uint64_t>(how.count / 10, 1),
                        .interval_ns = std::uint64_t{how.interval_us} * 1000};
    (void)binders->run(order, nullptr); // warms it up
    order.updates = how.count;
    const auto expected = order.binders * order.updates;
    latency_recorder record{expected};
    const auto cpu_before = all.cpu();
    const auto tally = binders->run(order, &record);
    const auto cpu = all.cpu() - cpu_before;
    const auto delivered = static_cast<double>(std::max<std::uint64_t>(tally.delivered, 1));
    figures found{.count = tally.delivered,
                  .latency = record.quantiles(),
                  .per_second = tally.took.count() == 0
                                    ? 0
                                    : static_cast<double>(tally.delivered) * 1e6 / microseconds(tally.took),
                  .cpu_us = microseconds(cpu) / delivered,
                  .lost = 1 - static_cast<double>(tally.delivered) / static_cast<double>(expected)};
    found.footprints = all.footprints();
    return found;
}

} // namespace

figures measure(const options& how) {
    const auto cores = usable_cores();
    const auto ends = place_ends();
    const auto what = how.mode == mode::task ? call::task : call::exchange;
    const auto with = make_peer(how.over);
    const bool is_spread = how.spread || about.on_all_cores;
    // Before the peer starts threads in this process.
    child_process server{ends.server, [&](const announce& tell) {
                             if (is_spread) {
                                 run_on(cores);
                             }
                             try {
                                 if (how.mode == mode::fan_out) {
                                     with->publish(tell);
                                 } else {
                                     with->serve(what, tell);
                                 }
                             } catch (const not_offered& why) {
                                 tell(std::string{no_offer} + why.what());
                             }
                         }};
    const auto where = server.announced();
    if (where.starts_with(no_offer)) {
        throw not_offered(where.substr(no_offer.size()));
    }
    if (!is_spread) {
        pin_to(ends.client);
    }
    const process_group all{server.id(), with->broker()};
    auto found = how.mode == mode::fan_out ? measure_fan_out(*with, where, how, all)
                                           : measure_calls(*with, what, where, how, all);
    found.program_bytes = loaded_program_bytes();
    return found;
}

} // namespace cles::perf::peers
