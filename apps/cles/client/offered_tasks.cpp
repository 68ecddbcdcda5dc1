// SPDX-License-Identifier: BSL-1.0
#include "client/offered_tasks.hpp"

#include "output/json_node.hpp"

namespace tool {

std::vector<offered_task> offered_tasks(const json_node* tasks) {
    std::vector<offered_task> out;
    if (tasks == nullptr) {
        return out;
    }
    for (const auto& entry : tasks->elements) {
        const auto* verb = entry.find("verb");
        const auto* task = entry.find("task");
        const auto* description = entry.find("description");
        const auto* parameters = entry.find("parameters");
        if (verb != nullptr && task != nullptr) {
            out.push_back({.verb = verb->text,
                           .task = task->text,
                           .description = description != nullptr ? description->text : "",
                           .has_parameters = parameters != nullptr && !parameters->elements.empty()});
        }
    }
    return out;
}

} // namespace tool
