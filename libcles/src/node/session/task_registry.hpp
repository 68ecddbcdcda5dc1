// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>
#include <cles/request.hpp>
#include <cles/task_info.hpp>
#include <cles/verb.hpp>

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

namespace cles::core {

class call;

/// A handler as the core runs it. At most one of the two functions is set.
struct handler {
    bool present = false;
    task_info info{};
    std::function<void(const request&, json_writer&)> plain{};
    std::function<void(const request&, const std::shared_ptr<call>&)> start{};
};

/// The tasks that a node offers.
class task_registry {
  public:
    /// \throws cles::error: `invalid_name`, `already_registered`
    void add(cles::verb verb, std::string_view task, handler entry);

    /// The handler, or null.
    [[nodiscard]] const handler* find(cles::verb verb, std::string_view task) const noexcept;
    /// Whether a BIND of the task is served: BIND or UPDATE is registered for it.
    [[nodiscard]] bool can_bind(std::string_view task) const noexcept;

    using handlers = std::array<handler, verb_count>;
    /// All tasks, sorted by name.
    [[nodiscard]] const std::map<std::string, handlers, std::less<>>& tasks() const noexcept { return tasks_; }

  private:
    std::map<std::string, handlers, std::less<>> tasks_;
};

/// \throws cles::error with `invalid_name` unless `task` is a valid name other than "cles"
void check_task_name(std::string_view task);

} // namespace cles::core
