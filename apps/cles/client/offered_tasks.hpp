// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <vector>

namespace tool {

struct json_node;

/// A task as a node describes it in its answer to PULL self:cles.
struct offered_task {
    std::string verb;
    std::string task;
    std::string description{};
    bool has_parameters = false;
};

/// From the value of "tasks" there, in its order; none if it is null. Entries without a verb or a task are ignored.
std::vector<offered_task> offered_tasks(const json_node* tasks);

} // namespace tool
