// SPDX-License-Identifier: BSL-1.0
#include "simulation/network/graph.hpp"

#include "node/membership/announcement.hpp"

#include <cmath>
#include <deque>

namespace cles::simulation {

graph graph::of(mesh_form form, unsigned nodes, unsigned mean_degree, dice& chance) {
    graph g{nodes};
    const auto side = static_cast<unsigned>(std::lround(std::sqrt(nodes)));
    for (unsigned i = 1; i < nodes; ++i) {
        switch (form) {
        case mesh_form::line:
        case mesh_form::ring: g.add(i - 1, i); break;
        case mesh_form::star: g.add(0, i); break;
        case mesh_form::grid:
            if (i % side != 0) {
                g.add(i - 1, i);
            }
            if (i >= side) {
                g.add(i - side, i);
            }
            break;
        case mesh_form::random: g.add(chance.below(i), i); break;
        }
    }
    if (form == mesh_form::ring) {
        g.add(nodes - 1, 0);
    }
    if (form == mesh_form::random) {
        for (unsigned links = nodes - 1; links < nodes * mean_degree / 2;) {
            const auto a = chance.below(nodes);
            const auto b = chance.below(nodes);
            if (a != b && !g.has(a, b) && g.of(a).size() < core::max_links && g.of(b).size() < core::max_links) {
                g.add(a, b);
                ++links;
            }
        }
    }
    return g;
}

std::vector<std::optional<unsigned>> graph::distances(unsigned from) const {
    std::vector<std::optional<unsigned>> found(size());
    found[from] = 0;
    for (std::deque<unsigned> open{from}; !open.empty(); open.pop_front()) {
        for (const auto next : neighbours_[open.front()]) {
            if (!found[next]) {
                found[next] = *found[open.front()] + 1;
                open.push_back(next);
            }
        }
    }
    return found;
}

} // namespace cles::simulation
