// SPDX-License-Identifier: BSL-1.0
#include "simulation/workload/talking.hpp"

#include "simulation/workload/talker.hpp"
#include "simulation/world/world.hpp"

namespace cles::simulation {

talking::~talking() = default;

void talking::perform(const action& a) {
    constexpr std::uint32_t first = 1'000'000; // above all that nodes ask
    constexpr std::uint32_t apart = 1000;
    constexpr unsigned hosts_of_clients = 100;
    if (a.what == deed::jump) { // by its clock they have taken nothing for long
        excuse(a["host"]);
    }
    if (a.what != deed::talk || world_.node(a["to"]) == nullptr) {
        return;
    }
    const talker::manner how{.to = a["to"],
                             .first_op = first + a["op"] * apart,
                             .lines = std::min(a["lines"], apart - 2),
                             .gap = std::chrono::milliseconds{a["gap"]},
                             .slow = std::chrono::milliseconds{a["slow"]},
                             .end = static_cast<talker::ending>(a["end"] % 3)};
    const auto made = std::make_shared<talker>(world_.net(), hosts_of_clients + a["op"], dice{a["style"]}, how,
                                               world_.node(a["to"])->bounds());
    talkers_.push_back(made);
    made->start();
}

void talking::on_crash(node_run& n) { excuse(n.host()); }
void talking::on_leaving(node_run& n) { excuse(n.host()); }

void talking::excuse(unsigned host) {
    for (const auto& t : talkers_) {
        if (t->to() == host) {
            t->excuse();
        }
    }
}

void talking::wind_down() {
    for (const auto& t : talkers_) {
        t->judge_and_leave();
    }
}

} // namespace cles::simulation
