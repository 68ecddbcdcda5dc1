// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/dice.hpp"

#include <boost/describe/enum.hpp>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace cles::simulation {

/// Which nodes of a mesh have links to each other.
BOOST_DEFINE_FIXED_ENUM_CLASS(mesh_form, std::uint8_t, line, ring, star, grid, random);

/// The name of the node on a host of a mesh.
inline std::string mesh_name(unsigned host) { return "n" + std::to_string(host); }

/// Links between the hosts of a mesh.
class graph {
  public:
    explicit graph(unsigned nodes) : neighbours_(nodes) {}

    /// \param mean_degree of a random mesh
    static graph of(mesh_form form, unsigned nodes, unsigned mean_degree, dice& chance);

    [[nodiscard]] unsigned size() const noexcept { return static_cast<unsigned>(neighbours_.size()); }
    [[nodiscard]] const std::set<unsigned>& of(unsigned host) const { return neighbours_.at(host); }
    [[nodiscard]] bool has(unsigned a, unsigned b) const { return neighbours_.at(a).contains(b); }
    void add(unsigned a, unsigned b) {
        neighbours_.at(a).insert(b);
        neighbours_.at(b).insert(a);
    }
    void remove(unsigned a, unsigned b) {
        neighbours_.at(a).erase(b);
        neighbours_.at(b).erase(a);
    }
    /// The number of links from one host to each other; nothing where no route leads.
    [[nodiscard]] std::vector<std::optional<unsigned>> distances(unsigned from) const;
    [[nodiscard]] bool is_connected() const {
        const auto all = distances(0);
        return std::ranges::all_of(all, [](const auto& each) { return each.has_value(); });
    }

  private:
    std::vector<std::set<unsigned>> neighbours_;
};

} // namespace cles::simulation
