// SPDX-License-Identifier: BSL-1.0
#include "client/told_types.hpp"

#include <cles/error.hpp>
#include <cles/json_reader.hpp>

#include "client/client.hpp"
#include "client/routed_request.hpp"

#include <utility>

namespace tool {

namespace asio = boost::asio;

namespace {

// The schema of the body; empty if none is told.
std::string body_schema_of(const std::vector<told_types>& told, cles::verb verb) {
    for (const auto& each : told) {
        if (each.verb == to_string(verb)) {
            return each.schemas.body;
        }
    }
    return {};
}

} // namespace

std::vector<told_types> read_told_types(const std::string& answer) {
    std::vector<told_types> out;
    cles::json_reader reader{answer, 35}; // as deep as results may be
    std::string_view key;
    bool good = reader.begin_object();
    while (good && reader.next_key(key)) {
        told_types made{.verb = std::string{key}, .schemas = {}};
        std::string_view raw;
        good = reader.read_raw(raw);
        if (good) {
            made.schemas = cles::read_task_types(raw);
            out.push_back(std::move(made));
        }
    }
    if (!good || !reader.at_end()) {
        throw cles::error(cles::errc::conversion, "the types that the node tells are not valid: " + reader.error());
    }
    return out;
}

asio::awaitable<std::string> ask_for_types(client& requester, std::string noun, cles::call_options options,
                                           std::vector<std::string> routers) {
    const auto colon = noun.find(':');
    const auto path = noun.substr(colon + 1);
    const auto command = "PULL " + noun.substr(0, colon) + ":cles/types/" + path.substr(0, path.find('/'));
    cles::json_text answer = co_await send_routed(requester, command, options, routers);
    co_return std::move(answer.text);
}

asio::awaitable<std::string> ask_for_body_schema(client& requester, cles::verb verb, std::string noun,
                                                 cles::call_options options, std::vector<std::string> routers) {
    std::string told;
    try {
        const std::string answer =
            co_await ask_for_types(requester, std::move(noun), std::move(options), std::move(routers));
        told = body_schema_of(read_told_types(answer), verb);
    } catch (const cles::error& e) {
        if (e.code() == cles::errc::cancelled) {
            throw;
        }
        told.clear(); // the request itself tells what is wrong
    }
    co_return told;
}

std::string body_mismatch(const std::string& schema, const std::string& body) {
    try {
        return schema.empty() ? std::string{} : cles::schema{schema}.mismatch(body);
    } catch (const cles::error&) { // it is none
        return {};
    }
}

std::string example_body(const std::vector<told_types>& told, cles::verb verb) {
    const auto schema = body_schema_of(told, verb);
    return schema.empty() ? std::string{} : cles::schema{schema}.example();
}

} // namespace tool
