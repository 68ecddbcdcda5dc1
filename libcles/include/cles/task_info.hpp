// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/text_list.hpp>

#include <string>

namespace cles {

/// The description of a task; shown by `PULL node:cles` and the `cles info` command.
struct task_info {
    std::string description{};
    text_list parameters{};  ///< their names, in order
    bool idempotent = false; ///< running it twice has the same effect as once
    bool inline_ok = false;  ///< in the runtime: quick enough to run on the I/O thread
    /// Its jobs are not moved to other nodes, because they need the state, files or devices of this one
    /// (docs/sharing.md).
    bool local = false;
    /// Its requests, except BIND, run only with the signature of a member of the fleet, and updates of the task's nouns
    /// are signed. A node without security refuses both with `denied`.
    bool must_be_signed = false;
    /// What it tells about its types, as `cles::task_types` makes it; set by `cles::typed_registrar`
    /// (<cles/types.hpp>).
    std::string types{};
};

} // namespace cles
