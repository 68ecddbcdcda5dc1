// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include <boost/describe/class.hpp>

#include <map>
#include <string>
#include <vector>

namespace tool {

/// Options that are saved under a name, for commands that talk to nodes. What is empty was not given.
struct saved_context {
    std::string at{};
    std::vector<std::string> peers{}; ///< NAME=URL
    std::string keys{};
    std::vector<std::string> local_users{}; ///< USER=MEMBER
    std::string multicast{};
    std::string pool{};

    bool operator==(const saved_context&) const = default;
};
BOOST_DESCRIBE_STRUCT(saved_context, (), (at, peers, keys, local_users, multicast, pool))
CLES_DEFAULTS(saved_context, (at, peers, keys, local_users, multicast, pool))

/// The file of the user in which they are saved.
struct saved_contexts {
    std::string used{}; ///< the name of the one that commands use; empty: none
    std::map<std::string, saved_context> contexts{};
};
BOOST_DESCRIBE_STRUCT(saved_contexts, (), (used, contexts))
CLES_DEFAULTS(saved_contexts, (used, contexts))

/// Empty if there is no file yet. \throws usage_error if it cannot be read
saved_contexts read_contexts();
/// Replaces the file. \throws std::runtime_error if it cannot be written
void write_contexts(const saved_contexts& all);

/// The name of the context that commands use: CLES_CONTEXT, if it is set, otherwise the one in the file; empty: none.
std::string name_of_used_context(const saved_contexts& all);
/// That context; empty if there is none. The file is read once. \throws usage_error if it cannot be read, or there is
/// no context of that name
const saved_context& used_context();

} // namespace tool
