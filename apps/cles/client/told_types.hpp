// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/schema.hpp>
#include <cles/verb.hpp>

#include <boost/asio/awaitable.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace tool {

class client;

/// What a node tells about the types of one verb of a task.
struct told_types {
    std::string verb;
    cles::task_schemas schemas;
};

/// Reads the answer to PULL self:cles/types/<task>. \throws cles::error with `conversion` if it is not one
std::vector<told_types> read_told_types(const std::string& answer);

/// Asks the node of that noun for the types of its task, and returns the answer. `routers` is as for `send_routed`.
/// \throws cles::error if it tells none, or does not answer
boost::asio::awaitable<std::string> ask_for_types(client& requester, std::string noun, cles::call_options options,
                                                  std::vector<std::string> routers);

/// The schema of the bodies that the node of that noun takes; empty if it tells none, or does not answer.
/// \throws cles::error with `cancelled`
boost::asio::awaitable<std::string> ask_for_body_schema(client& requester, cles::verb verb, std::string noun,
                                                        cles::call_options options, std::vector<std::string> routers);

/// Why a body does not fit a schema; empty if it does, or if the schema is empty or not valid: the request itself tells
/// then what is wrong.
std::string body_mismatch(const std::string& schema, const std::string& body);

/// A body that fits; empty if nothing is told about bodies of that verb. \throws cles::error with `conversion`
std::string example_body(const std::vector<told_types>& told, cles::verb verb);

} // namespace tool
