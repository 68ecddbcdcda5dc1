// SPDX-License-Identifier: BSL-1.0
// What an HTTP client sends to the gateway: the same requests are read however the bytes arrive, and what is asked of
// the network is one valid line.
#include "fuzz/fuzz.hpp"
#include "gateway/access/origin.hpp"
#include "gateway/http/request_reader.hpp"
#include "gateway/http/route.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace cles::fuzz {
namespace {

using step = gateway::request_reader::step;

struct conversation {
    std::vector<gateway::http_request> requests{};
    int refused = 0; ///< the status that ends it; 0: it goes on
};

conversation read(std::string_view bytes, std::size_t at_once) {
    conversation made;
    gateway::request_reader reader;
    while (made.refused == 0) {
        const auto next = reader.advance();
        if (next == step::complete) {
            made.requests.push_back(reader.request());
            reader.next();
        } else if (next == step::refused) {
            made.refused = reader.why().status;
            require(made.refused >= 400 && !reader.why().message.empty(), "a refusal says why");
        } else if (next == step::incomplete) {
            if (bytes.empty()) {
                break;
            }
            const auto part = bytes.substr(0, at_once);
            reader.add(part);
            bytes.remove_prefix(part.size());
        }
    }
    return made;
}

std::string text_of(const gateway::http_request& request) {
    std::string out = request.method + " " + request.target + "\n";
    for (const auto& [name, value] : request.fields) {
        out.append(name).append(": ").append(value).append("\n");
    }
    return out + request.body + (request.keep_alive ? "+" : "-");
}

void check_line(const gateway::route& where, std::string_view body) {
    std::string line{to_string(where.verb)};
    line.append(" ").append(where.noun).append(body.empty() ? "" : " ").append(body);
    require(line.find_first_of(std::string_view{"\n\r\0", 3}) == std::string::npos, "a request is one line", line);
    protocol::request_line parsed;
    protocol::malformed_request error;
    require(protocol::parse_request(line, parsed, error), "a request is valid", line);
    require(parsed.verb == where.verb && parsed.body == body && parsed.noun.target == where.target,
            "it is the request that was meant", line);
    require(parsed.verb == verb::pull || parsed.noun.task != "cles", "of the reserved task, it is a PULL", line);
}

void check(const gateway::http_request& request) {
    const gateway::origin_rules rules{.hosts = {"fleet.example"}, .origins = {"https://fleet.example"}};
    const auto refused = gateway::origin_refusal(rules, request, false);
    const auto from = gateway::origin_of(rules, request);
    require(refused || from != gateway::origin::foreign, "pages of other origins are refused");
    require(from == gateway::origin::allowed || gateway::cors_fields(rules, request).empty(),
            "no other origin is told that it may read");
    const auto found = gateway::route_of(request.method, request.target);
    const auto* const where = std::get_if<gateway::route>(&found);
    const auto body = gateway::body_of(request);
    const auto* const text = std::get_if<std::string>(&body);
    if (where != nullptr && where->to == gateway::place::fleet && text != nullptr) {
        check_line(*where, where->verb == verb::pull || where->verb == verb::bind ? std::string_view{} : *text);
    }
}

} // namespace

void run(std::string_view input) {
    const auto whole = read(input, input.size());
    const auto split = read(input, 1);
    constexpr int head_too_long = 431; // how much of it has arrived decides
    if (whole.refused != head_too_long && split.refused != head_too_long) {
        const bool same = std::ranges::equal(whole.requests, split.requests, {}, text_of, text_of);
        require(same, "the requests are the same however they arrive", input);
    }
    for (const auto& request : whole.requests) {
        check(request);
    }
}

} // namespace cles::fuzz
