// SPDX-License-Identifier: BSL-1.0
#include "node/session/task_registry.hpp"

#include <cles/error.hpp>

#include "protocol/grammar.hpp"

#include <utility>

namespace cles::core {

void check_task_name(std::string_view task) {
    if (!protocol::is_name(task)) {
        throw error(errc::invalid_name,
                    protocol::quoted(task) + " is not a task's name (1 to 64 letters, digits, '_', '-', '.')");
    }
    if (task == "cles") {
        throw error(errc::invalid_name, "the task 'cles' is reserved");
    }
}

void task_registry::add(cles::verb verb, std::string_view task, handler entry) {
    check_task_name(task);
    auto& slot = tasks_[std::string{task}][static_cast<std::size_t>(verb)];
    if (slot.present) {
        throw error(errc::already_registered, std::string{to_string(verb)} + " '" + std::string{task} + "'");
    }
    slot = std::move(entry);
    slot.present = true;
}

const handler* task_registry::find(cles::verb verb, std::string_view task) const noexcept {
    const auto found = tasks_.find(task);
    if (found == tasks_.end()) {
        return nullptr;
    }
    const auto& entry = found->second[static_cast<std::size_t>(verb)];
    return entry.present ? &entry : nullptr;
}

bool task_registry::can_bind(std::string_view task) const noexcept {
    return find(verb::bind, task) != nullptr || find(verb::update, task) != nullptr;
}

} // namespace cles::core
