// SPDX-License-Identifier: BSL-1.0
#include "node/routing/task_list.hpp"

#include "json/json_members.hpp"
#include "protocol/grammar.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {
namespace {

bool read_entry(json_reader& r, task_list& out) {
    task_list::entry found;
    std::string name;
    const bool good = read_members(r, [&](std::string_view key) {
        return key == "verb"         ? r.read(name)
               : key == "task"       ? r.read(found.task)
               : key == "idempotent" ? r.read(found.idempotent)
                                     : r.skip();
    });
    if (!good) {
        return false;
    }
    const auto verb = verb_from(name);
    if (verb && protocol::is_name(found.task) && out.entries.size() < max_tasks_of_a_node) {
        found.verb = *verb;
        out.entries.push_back(std::move(found));
    }
    return true;
}

bool read_entries(json_reader& r, task_list& out) {
    if (!r.begin_array()) {
        return false;
    }
    while (r.next_element()) {
        if (!read_entry(r, out)) {
            return false;
        }
    }
    return r.ok();
}

} // namespace

const task_list::entry* task_list::find(cles::verb verb, std::string_view task) const noexcept {
    const auto found =
        std::find_if(entries.begin(), entries.end(), [&](const entry& e) { return e.verb == verb && e.task == task; });
    return found == entries.end() ? nullptr : &*found;
}

std::optional<task_list> read_task_list(std::string_view description, std::string_view node) {
    json_reader r{description};
    task_list list;
    std::string name;
    const bool good = read_members(r, [&](std::string_view key) {
        return key == "node" ? r.read(name) : key == "tasks" ? read_entries(r, list) : r.skip();
    });
    if (!good || !r.at_end() || name != node) {
        return std::nullopt;
    }
    return list;
}

} // namespace cles::core
