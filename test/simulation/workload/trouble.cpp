// SPDX-License-Identifier: BSL-1.0
#include "simulation/workload/trouble.hpp"

#include "simulation/world/world.hpp"

#include <memory>

namespace cles::simulation {

using std::chrono::milliseconds;

void trouble::perform(const action& a) {
    auto& net = world_.net();
    switch (a.what) {
    case deed::crash: world_.crash(a["host"], milliseconds{a["down"]}); break;
    case deed::freeze:
        if (auto* n = world_.node(a["host"])) {
            world_.watcher().saw(n->name(), "is stopped");
            n->freeze();
            world_.time().at(world_.time().now() + milliseconds{a["for"]}, [weak = n->weak_from_this()] {
                if (const auto alive = weak.lock()) {
                    alive->thaw();
                }
            });
        }
        break;
    case deed::part:
        world_.watcher().saw("net", "is parted");
        net.part(a["a"], a["b"], world_.time().now() + milliseconds{a["for"]});
        break;
    case deed::mute:
        world_.watcher().saw("net", "is parted one way");
        net.mute(a["from"], a["to"], world_.time().now() + milliseconds{a["for"]});
        break;
    case deed::jump:
        if (auto* n = world_.node(a["host"])) {
            world_.watcher().saw(n->name(), "has its clock set");
            n->jump(milliseconds{a["ahead"]});
        }
        break;
    case deed::retire: world_.retire(a["host"], milliseconds{a["limit"]}, milliseconds{a["down"]}); break;
    case deed::cut: net.cut(a["host"], a["which"]); break;
    case deed::weather:
        world_.watcher().saw("net", "changes");
        net.set({.lost = a["lost"],
                 .doubled = a["doubled"],
                 .late = a["late"],
                 .least = milliseconds{a["least"]},
                 .spread = milliseconds{a["spread"]}});
        break;
    default: break;
    }
}

} // namespace cles::simulation
