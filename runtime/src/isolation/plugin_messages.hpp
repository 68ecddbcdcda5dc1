// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>
#include <cles/task_info.hpp>

#include "isolation/isolation_limits.hpp"

#include <boost/describe/class.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

/// What the daemon and the process of an isolated plugin tell each other with the reserved task `cles`, as bodies of
/// their lines. The requests of the plugin's own tasks, and their replies, are those of the language.

namespace cles {

// Without `inline_ok`: a handler in another process never runs on the daemon's I/O thread.
BOOST_DESCRIBE_STRUCT(task_info, (), (description, parameters, idempotent, local, must_be_signed, types))

} // namespace cles

namespace cles::runtime {

/// The reserved task.
inline constexpr std::string_view control_task = "cles";

/// `PUSH self:cles/load`: the first line, from the daemon.
struct load_message {
    std::string node;
    std::string path;   ///< of the plugin, as `plugin_host::load` takes it
    std::string config; ///< its settings, JSON
    std::string sha256;
    std::vector<std::string> folders; ///< where plugins are searched for
    bool secured = false;
    isolation_limits limits;
    bool require_paths = true; ///< all of the limits have to exist
};
BOOST_DESCRIBE_STRUCT(load_message, (), (node, path, config, sha256, folders, secured, limits, require_paths))

struct offered_task {
    std::string verb;
    std::string task;
    task_info info;
    bool handled = true; ///< false: it can only be bound
};
BOOST_DESCRIBE_STRUCT(offered_task, (), (verb, task, info, handled))
inline bool operator==(const offered_task& one, const offered_task& other) { return to_json(one) == to_json(other); }

/// `PUSH self:cles/started`, from the plugin's process.
struct started_message {
    std::string name;
    std::string version;
    std::string confinement;          ///< that is in force
    std::vector<std::string> missing; ///< of it
    std::vector<offered_task> tasks;
};
BOOST_DESCRIBE_STRUCT(started_message, (), (name, version, confinement, missing, tasks))

/// `PUSH self:cles/refused`, from the plugin's process, which ends then.
struct refused_message {
    std::string why;
    std::string key; ///< that is to blame, as in `plugin_error`
};
BOOST_DESCRIBE_STRUCT(refused_message, (), (why, key))

/// Longer entries of the log are cut.
inline constexpr std::size_t max_log_text = 4096;

/// `PUSH self:cles/log` and `PUSH self:cles/log/<id>`, from the plugin's process.
struct log_message {
    std::uint32_t level = 0;
    std::string text;
};
BOOST_DESCRIBE_STRUCT(log_message, (), (level, text))

/// `DELEGATE self:cles/ask/<id>/<ticket>`, from the plugin's process: a request on behalf of a job.
struct ask_message {
    std::string command;
    std::string at;
    bool urgent = false;
    std::uint32_t hops = 8;
    std::int64_t deadline_ms = 0;
    bool progress = false;
};
BOOST_DESCRIBE_STRUCT(ask_message, (), (command, at, urgent, hops, deadline_ms, progress))

/// `PUSH self:cles/bind/<id>/<feed>`, from the plugin's process: a binding of a job. `next/<id>/<feed>/<ticket>` asks
/// for an event of it, which is answered as an `ask` is, and `unbind/<id>/<feed>` ends it.
struct bind_message {
    std::string noun;
    std::string at;
    std::uint32_t keep = 0;
    std::int64_t every_ms = 0;
    std::uint32_t hops = 8;
    std::int64_t deadline_ms = 0;
    bool mark = false;
};
BOOST_DESCRIBE_STRUCT(bind_message, (), (noun, at, keep, every_ms, hops, deadline_ms, mark))

/// The kinds of events in lines, in the order of `feed_event`.
inline constexpr std::array<std::string_view, 5> event_names{"current", "update", "gap", "lost", "rebound"};

} // namespace cles::runtime
