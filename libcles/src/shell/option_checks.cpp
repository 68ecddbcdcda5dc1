// SPDX-License-Identifier: BSL-1.0
#include "shell/option_checks.hpp"

#include "protocol/message.hpp"

#include <algorithm>

namespace cles::shell {
namespace {

std::string negative(const char* option, std::chrono::milliseconds value) {
    return std::string{option} + " is " + std::to_string(value.count()) + " ms: a time from 0";
}

} // namespace

std::string objection_to(const call_options& options) {
    return options.deadline_.count() < 0 ? negative("call_options::deadline", options.deadline_) : std::string{};
}

std::string objection_to(const bind_options& options) {
    if (options.deadline_.count() < 0) {
        return negative("bind_options::deadline", options.deadline_);
    }
    if (options.every_.count() < 0) {
        return negative("bind_options::every", options.every_);
    }
    if (options.keep_ > protocol::max_keep) {
        return "bind_options::keep is " + std::to_string(options.keep_) + ": 1 to " +
               std::to_string(protocol::max_keep) + ", or 0 for the default";
    }
    return {};
}

std::chrono::milliseconds time_limit(std::chrono::milliseconds deadline, verb of) {
    if (deadline.count() <= 0) {
        return std::chrono::milliseconds{protocol::default_deadline(of)};
    }
    return std::min(deadline, std::chrono::milliseconds{protocol::max_deadline_ms});
}

} // namespace cles::shell
