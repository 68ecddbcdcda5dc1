// SPDX-License-Identifier: BSL-1.0
#include "gateway/http/route.hpp"

#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/parameter.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <utility>

namespace gateway {
namespace {

constexpr std::size_t longest_name = 64;
constexpr std::uint64_t most_ms = 86'400'000; // a day, as in the protocol
constexpr std::uint64_t most_kept = 65'536;

struct fixed_path {
    std::string_view path;
    place to;
    std::string_view methods;
};
constexpr std::array fixed_paths{fixed_path{"/session", place::session, "GET, POST, DELETE"},
                                 fixed_path{"/metrics", place::metrics, "GET"},
                                 fixed_path{"/openapi.json", place::openapi, "GET"}};

constexpr std::array verb_paths{verb_path{"pull", cles::verb::pull, "GET"}, verb_path{"bind", cles::verb::bind, "GET"},
                                verb_path{"push", cles::verb::push, "POST"},
                                verb_path{"delegate", cles::verb::delegate, "POST"},
                                verb_path{"update", cles::verb::update, "POST"}};

refusal wrong(std::string message) { return {.status = 400, .message = std::move(message), .fields = {}}; }

// Nothing if the method is one of those that are allowed.
std::optional<refusal> wrong_method(std::string_view method, std::string_view allowed) {
    for (auto left = allowed; !left.empty();) {
        if (take_part(left, ',') == method) {
            return std::nullopt;
        }
    }
    const std::string all{allowed};
    return refusal{.status = 405, .message = "the method here is " + all, .fields = {{"Allow", all}}};
}

std::optional<std::uint64_t> number_up_to(std::string_view text, std::uint64_t most) {
    std::uint64_t number = 0;
    const auto* const end = text.data() + text.size();
    const auto [rest, code] = std::from_chars(text.data(), end, number);
    const bool good = code == std::errc{} && rest == end && number >= 1 && number <= most;
    return good ? std::optional{number} : std::nullopt;
}

// A segment of the path without its escapes; nothing if one is not valid.
std::optional<std::string> decoded_segment(std::string_view segment) {
    std::string out;
    for (std::size_t i = 0; i < segment.size(); ++i) {
        unsigned byte = static_cast<unsigned char>(segment[i]);
        if (segment[i] == '%') {
            const auto digits = segment.substr(i + 1, 2);
            const auto [rest, code] = std::from_chars(digits.data(), digits.data() + digits.size(), byte, 16);
            if (digits.size() != 2 || code != std::errc{} || rest != digits.data() + 2) {
                return std::nullopt;
            }
            i += 2;
        }
        out.push_back(static_cast<char>(byte));
    }
    return out;
}

// "car1", "localization", "fast": sets noun and target. Returns what is wrong; empty if nothing is.
std::string take_segment(route& to, std::size_t index, std::string_view segment) {
    const auto decoded = decoded_segment(segment);
    if (!decoded) {
        return "'%' in a path begins an escape of two hex digits";
    }
    if (*decoded == "." || *decoded == "..") { // programs on the way treat them as steps
        return "'.' and '..' are not allowed in a path";
    }
    if (index < 2 && !is_node_or_task(*decoded)) {
        return "a node and a task have 1 to 64 letters, digits, '_', '-', '.'";
    }
    if (index == 0) {
        to.noun = to.target = *decoded;
    } else if (index == 1) {
        to.noun.append(":").append(*decoded);
    } else {
        try {
            to.noun.append("/").append(cles::encode_parameter(*decoded));
        } catch (const cles::error&) {
            return "a parameter is empty, not UTF-8, or contains control characters";
        }
    }
    return index < most_parameters + 2 ? std::string{} : "a noun has at most 32 parameters";
}

std::string take_query(route& to, std::string_view query) {
    while (!query.empty()) {
        auto value = take_part(query, '&');
        const auto key = take_part(value, '=');
        const bool is_every = key == "every";
        if (to.verb != cles::verb::bind || (!is_every && key != "keep")) {
            return "the only parts of a query are 'every' and 'keep', of /bind";
        }
        const auto number = number_up_to(value, is_every ? most_ms : most_kept);
        if (!number) {
            return is_every ? "'every' is 1 to 86400000, in milliseconds" : "'keep' is 1 to 65536";
        }
        if (is_every) {
            to.every = std::chrono::milliseconds{static_cast<std::int64_t>(*number)};
        } else {
            to.keep = static_cast<std::uint32_t>(*number);
        }
    }
    return {};
}

std::variant<route, refusal> fleet_route(const verb_path& how, std::string_view rest, std::string_view query) {
    route made{.to = place::fleet, .path = {}, .verb = how.verb};
    std::size_t index = 0;
    for (bool more = true; more; ++index) {
        const auto segment = rest.substr(0, rest.find('/'));
        more = segment.size() < rest.size();
        rest.remove_prefix(std::min(segment.size() + 1, rest.size()));
        if (auto why = take_segment(made, index, segment); !why.empty()) {
            return wrong(std::move(why));
        }
    }
    if (index < 2) {
        return wrong("write /" + std::string{how.name} + "/NODE/TASK, and parameters after the task");
    }
    if (auto why = take_query(made, query); !why.empty()) {
        return wrong(std::move(why));
    }
    const auto task = std::string_view{made.noun}.substr(made.target.size() + 1);
    if (how.verb != cles::verb::pull && task.substr(0, task.find('/')) == "cles") {
        return refusal{.status = 403,
                       .message = "the task 'cles' takes PULL only here: its other requests concern a link",
                       .fields = {}};
    }
    return made;
}

} // namespace

const verb_path* find_verb_path(std::string_view verb) noexcept {
    const auto* const found =
        std::ranges::find_if(verb_paths, [verb](const verb_path& each) { return to_string(each.verb) == verb; });
    return found == verb_paths.end() ? nullptr : found;
}

bool is_node_or_task(std::string_view text) noexcept {
    return !text.empty() && text.size() <= longest_name && std::ranges::all_of(text, [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
               c == '.';
    });
}

std::variant<route, refusal> route_of(std::string_view method, std::string_view target) {
    if (!target.starts_with('/')) {
        return wrong("the target of the request is not a path");
    }
    const auto path = target.substr(0, target.find('?'));
    const auto query = target.substr(std::min(path.size() + 1, target.size()));
    route made{.path = std::string{path}};
    std::string_view methods = "GET";
    if (const auto* const fixed = std::ranges::find(fixed_paths, path, &fixed_path::path); fixed != fixed_paths.end()) {
        made.to = fixed->to;
        methods = fixed->methods;
    }
    const auto first = path.substr(1, path.find('/', 1) - 1);
    const auto* const verb = std::ranges::find(verb_paths, first, &verb_path::name);
    if (auto why = wrong_method(method, verb != verb_paths.end() ? verb->method : methods)) {
        return std::move(*why);
    }
    if (verb != verb_paths.end()) {
        return fleet_route(*verb, path.substr(std::min(first.size() + 2, path.size())), query);
    }
    return made;
}

std::variant<std::chrono::milliseconds, refusal> deadline_of(const http_request& request) {
    if (request.count("cles-deadline") == 0) {
        return std::chrono::milliseconds{0};
    }
    const auto ms = number_up_to(request.field("cles-deadline"), most_ms);
    if (!ms) {
        return wrong("Cles-Deadline is 1 to 86400000, in milliseconds");
    }
    return std::chrono::milliseconds{static_cast<std::int64_t>(*ms)};
}

std::variant<std::string, refusal> body_of(const http_request& request) {
    if (request.body.empty()) {
        return std::string{};
    }
    auto type = request.field("content-type");
    if (small_letters(take_part(type, ';')) != "application/json") {
        return refusal{.status = 415,
                       .message = "a body is JSON: state Content-Type: application/json",
                       .fields = {{"Accept", "application/json"}}};
    }
    std::string why;
    if (!cles::is_valid_json(request.body, 32, &why)) {
        return wrong("the body is not valid JSON: " + why);
    }
    const auto kind = cles::json_reader{request.body}.peek();
    const bool is_plain = kind != cles::json_reader::kind::object && kind != cles::json_reader::kind::array;
    std::string line = is_plain ? R"({"value":)" : "";
    cles::append_compact_json(request.body, line);
    return is_plain ? line + "}" : line;
}

} // namespace gateway
