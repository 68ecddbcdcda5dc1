// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

inline constexpr std::size_t max_tasks_of_a_node = 4096;

/// The tasks of a node, as it reports them.
struct task_list {
    struct entry {
        cles::verb verb = verb::pull;
        std::string task;
        bool idempotent = false;
    };
    std::vector<entry> entries;

    [[nodiscard]] const entry* find(cles::verb verb, std::string_view task) const noexcept;
};

/// Reads the reply to `PULL self:cles`. Nothing if it is malformed, or of another node.
std::optional<task_list> read_task_list(std::string_view description, std::string_view node);

} // namespace cles::core
