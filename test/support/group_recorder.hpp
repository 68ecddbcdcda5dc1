// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/publish/group_output.hpp"
#include "port/group_source.hpp"

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::test {

/// A source in the group that is not the node under test.
constexpr core::group_source source_at(std::uint16_t port) { return {.address = 0x7f000001, .port = port}; }

/// Records what a node sends to its group, as far as the test lets it.
class group_recorder final : public core::group_output {
  public:
    bool send(std::string_view line) override {
        sent_.emplace_back(line.substr(0, line.size() - 1));
        return true;
    }
    [[nodiscard]] bool has_room() const override { return room; }
    std::vector<std::string> take() { return std::exchange(sent_, {}); }
    [[nodiscard]] std::size_t count() const { return sent_.size(); }

    bool room = true;

  private:
    std::vector<std::string> sent_;
};

} // namespace cles::test
