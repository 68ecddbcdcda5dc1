// SPDX-License-Identifier: BSL-1.0
#include "node/session/command.hpp"

#include "node/local_node.hpp"
#include "protocol/datagram.hpp"
#include "protocol/grammar.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <string>
#include <utility>

namespace cles::core {
namespace {

// Other adverbs would have to be ignored: the library writes them itself.
std::string foreign_adverb(std::string_view command) {
    protocol::part_reader parts{command};
    parts.next(); // verb
    parts.next(); // noun
    for (auto part = parts.next(); !part.empty(); part = parts.next()) {
        if (!part.starts_with("deadline=") && part != "urgent=yes") {
            return "of the adverbs only 'deadline' and 'urgent' can be given here, not " + protocol::quoted(part);
        }
    }
    return {};
}

} // namespace

std::uint64_t send_command(local_node& by, std::string_view command, const call_options& options,
                           detail::pending_ptr operation, std::optional<std::chrono::milliseconds> left) {
    protocol::request_line parsed;
    protocol::malformed_request wrong;
    std::string why;
    if (!protocol::parse_request(command, parsed, wrong)) {
        why = wrong.why;
    } else if (parsed.is_update()) {
        why = "an update with 'seq' and 'epoch' is not a request";
    } else if (parsed.verb == verb::bind) {
        why = "a binding is made by async_bind";
    } else if (!parsed.body.empty()) {
        is_valid_json(parsed.body, by.bounds().depth, &why);
    }
    if (why.empty()) {
        why = foreign_adverb(command);
    }
    if (!why.empty()) {
        by.fail_later(std::move(operation), errc::bad_request, std::move(why));
        return 0;
    }
    auto chosen = options;
    if (chosen.deadline_.count() == 0 && parsed.deadline_ms != protocol::default_deadline(parsed.verb)) {
        chosen.deadline(std::chrono::milliseconds{parsed.deadline_ms});
    }
    if (left && chosen.deadline_.count() >= 0) {
        chosen.deadline(chosen.deadline_.count() > 0 ? std::min(chosen.deadline_, *left) : *left);
    }
    chosen.urgent(chosen.urgent_ || parsed.urgent);
    const auto noun = std::string{parsed.noun.target} + ":" + std::string{parsed.noun.path};
    return by.send(parsed.verb, noun, parsed.body, chosen, std::move(operation));
}

namespace {

std::string negative(const char* option, std::chrono::milliseconds value) {
    return std::string{option} + " is " + std::to_string(value.count()) + " ms: a time from 0";
}

} // namespace

std::string invalid_option_reason(const call_options& options) {
    return options.deadline_.count() < 0 ? negative("call_options::deadline", options.deadline_) : std::string{};
}

std::string invalid_option_reason(const bind_options& options) {
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

} // namespace cles::core
