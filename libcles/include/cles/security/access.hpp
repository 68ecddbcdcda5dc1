// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace cles::security {

struct access_question {
    std::string requester{};
    std::string forwarder{}; ///< the node that forwards, and states the requester; empty if there is none
    verb asked = verb::pull; ///< BIND also of the updates that follow
    std::string noun{};      ///< its target is the node that serves; `self` for the node of the directory
};

struct access_answer {
    bool allowed = false;
    std::string reason{};                ///< one word: "permitted", "rule", "may", ...
    std::string right{};                 ///< the rule, or the right, that decides; empty if there is none
    std::vector<std::string> lines{};    ///< what was decided, step by step, for people
    std::vector<std::string> warnings{}; ///< about files in the directory
};

/// Whether a member may request something of another, as the node whose directory this is decides it, and why. Without
/// a node's key in the directory, the roster alone decides.
/// \throws std::runtime_error with a message for people
[[nodiscard]] access_answer explain_access(const std::string& directory, const access_question& question);

} // namespace cles::security
