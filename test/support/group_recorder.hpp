// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/group_port.hpp"

#include <algorithm>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::test {

/// A source in the group that is not the node under test.
constexpr core::group_source source_at(std::uint16_t port) { return {.address = 0x7f000001, .port = port}; }

/// Records what a node sends to its group.
class group_recorder final : public core::group_port {
  public:
    explicit group_recorder(const core::group_source& self = source_at(4000)) : self_(self) {}

    void start(core::group_listener&) override {}
    core::lines_done send(std::string_view lines) override {
        const core::lines_done all{.lines = static_cast<std::size_t>(std::ranges::count(lines, '\n')),
                                   .bytes = lines.size()};
        while (!lines.empty()) {
            const auto size = lines.find('\n');
            sent_.emplace_back(lines.substr(0, size));
            lines.remove_prefix(size + 1);
        }
        return all;
    }
    [[nodiscard]] std::size_t unsent() const noexcept override { return writable ? 0 : 1; }
    void close() override {}
    [[nodiscard]] const core::group_source& source() const noexcept override { return self_; }

    std::vector<std::string> take() { return std::exchange(sent_, {}); }
    [[nodiscard]] std::size_t count() const { return sent_.size(); }
    /// For a session, which does not own it.
    [[nodiscard]] std::shared_ptr<core::group_port> share() { return {std::shared_ptr<void>{}, this}; }

    bool writable = true;

  private:
    core::group_source self_;
    std::vector<std::string> sent_;
};

} // namespace cles::test
