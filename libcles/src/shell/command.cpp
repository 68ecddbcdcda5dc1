// SPDX-License-Identifier: BSL-1.0
#include "shell/command.hpp"

#include "protocol/grammar.hpp"
#include "protocol/message.hpp"
#include "protocol/parts.hpp"
#include "shell/local_node.hpp"

#include <algorithm>
#include <string>
#include <utility>

namespace cles::shell {
namespace {

// What a command says beside its deadline would have to be ignored: the library writes the adverbs itself.
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

} // namespace cles::shell
