// SPDX-License-Identifier: BSL-1.0
#include "commands/task_types.hpp"

#include <cles/error.hpp>
#include <cles/schema.hpp>

#include "client/client.hpp"
#include "client/told_types.hpp"
#include "discovery/find_nodes.hpp"
#include "options/arguments.hpp"
#include "output/table.hpp"
#include "output/terminal.hpp"

#include <algorithm>
#include <cstddef>
#include <string_view>
#include <utility>
#include <vector>

namespace tool {

namespace asio = boost::asio;

namespace {

std::string members_text(const std::vector<cles::schema_member>& members) {
    table out{"MEMBER", "TYPE", "UNIT", "RANGE", "DEFAULT", "MEANING"};
    for (const auto& member : members) {
        const auto standard = !member.standard.empty() ? member.standard : member.required ? "" : "may be missing";
        out.row();
        std::size_t column = 0;
        for (const auto* text : {&member.path, &member.type, &member.unit, &member.range, &standard, &member.meaning}) {
            out.set(column++, printable(*text));
        }
    }
    return out.text();
}

void append_part(std::string& out, std::string_view verb, std::string_view name, const std::string& text) {
    if (text.empty()) {
        return;
    }
    const cles::schema told{text};
    out.append(out.empty() ? "" : "\n").append(bold(stream::out, std::string{verb} + " " + std::string{name}));
    out.append("  ").append(printable(told.summary())).append("\n");
    if (const auto members = told.members(); !members.empty()) {
        out.append(members_text(members));
    }
    if (const auto example = name == "body" ? told.example() : std::string{}; !example.empty()) {
        out.append("example  ").append(printable(example)).append("\n");
    }
}

std::string types_text(const std::vector<told_types>& told) {
    std::string out;
    for (const auto& each : told) {
        const auto verb = printable(each.verb);
        append_part(out, verb, "parameters", each.schemas.parameters);
        append_part(out, verb, "body", each.schemas.body);
        append_part(out, verb, "result", each.schemas.result);
        append_part(out, verb, "updates", each.schemas.updates);
    }
    return out;
}

} // namespace

asio::awaitable<void> show_task(client& requester, const address_book& addresses, const std::string& noun,
                                const std::optional<std::chrono::milliseconds>& timeout, output_format format) {
    const auto options = requester.options_for(noun, timeout);
    std::vector<std::string> routers;
    if (needs_router(addresses, noun)) {
        auto found = co_await possible_routers(requester, addresses);
        routers = std::move(found);
    }
    const std::string answer = co_await ask_for_types(requester, noun, options, routers);
    if (resolved(format) != output_format::table) {
        printer{format, false}.print(answer);
        co_return;
    }
    if (target_of(noun) == "all") {
        throw cles::error(cles::errc::no_target, "the types of all nodes are shown with -o json only");
    }
    const auto text = types_text(read_told_types(answer));
    write_output(text.empty() ? "the node tells no types of this task\n" : text);
}

} // namespace tool
