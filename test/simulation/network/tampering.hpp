// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "simulation/network/dice.hpp"
#include "simulation/network/place.hpp"
#include "simulation/network/planted.hpp"

#include <map>
#include <memory>
#include <set>
#include <string>

namespace cles::simulation {

/// What a planted fault does to the lines that a stream is about to carry; nothing, where none is planted.
class tampering {
  public:
    explicit tampering(planted fault) noexcept : fault_(fault) {}

    void apply(std::string& lines, const std::weak_ptr<place>& sender, dice& chance);

  private:
    planted fault_;
    // Which nouns each has bound.
    std::map<std::weak_ptr<place>, std::set<std::string, std::less<>>, std::owner_less<>> bound_;
};

} // namespace cles::simulation
