// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// What a node has said of its present incarnation, when it was asked.
struct confirmed_epoch {
    std::uint32_t epoch = 0;
    std::vector<std::string> signed_tasks{}; ///< whose updates it signs
};

/// The epochs that other nodes have confirmed, and when they were asked. Beyond the limit, the node that was asked
/// first is forgotten.
class confirmed_epochs {
  public:
    /// Between two questions to a node, at least.
    static constexpr std::chrono::seconds pause{1};

    explicit confirmed_epochs(std::size_t most) noexcept : max_entries_(most) {}

    [[nodiscard]] bool contain(std::string_view node, std::uint32_t epoch) const noexcept;
    void confirm(std::string_view node, confirmed_epoch said, time_point now);
    /// Null if it has confirmed none.
    [[nodiscard]] const confirmed_epoch* find(std::string_view node) const noexcept;
    /// When the node may be asked again; the past if it was not asked.
    [[nodiscard]] time_point next_question(std::string_view node) const noexcept;
    void on_asked(std::string_view node, time_point now);
    [[nodiscard]] std::size_t size() const noexcept { return nodes_.size(); }

  private:
    struct entry {
        std::optional<confirmed_epoch> said{};
        time_point next_question = time_point::min();
        time_point used{};
    };

    entry& of(std::string_view node, time_point now);

    std::size_t max_entries_;
    std::map<std::string, entry, std::less<>> nodes_;
};

} // namespace cles::core
