// SPDX-License-Identifier: BSL-1.0
// A reply line, including failures: what is read is what is written, and a failure is always valid JSON.
#include "protocol/reply_line.hpp"

#include <cles/json_reader.hpp>

#include "fuzz/fuzz.hpp"
#include "protocol/line.hpp"
#include "protocol/request_line.hpp"

#include <string>

namespace cles::fuzz {
namespace {

namespace p = protocol;

void check_failure(std::string_view body) {
    p::failure why;
    const bool valid = is_valid_json(body);
    require(p::parse_failure(body, why) == valid, "a failure is read where it is JSON", body);
    if (!valid) {
        return;
    }
    std::string text;
    p::append_failure(text, why);
    require(p::is_failure(text) && p::begins_with_error(text), "a failure looks like one", text);
    require(is_valid_json(text), "a failure is JSON", text);
    p::failure again;
    require(p::parse_failure(text, again), "a failure that was written is read", text);
    require(again.code == why.code && again.message == why.message && again.ran == why.ran, "it is the same", text);
    require(!why.retry_ms || again.retry_ms == why.retry_ms, "it says when to come again", text);
}

} // namespace

void run(std::string_view input) {
    const auto line = p::trim(input.substr(0, input.find('\n')));
    if (line.starts_with("{\"error\":\"")) {
        check_failure(line);
    }
    p::reply_line reply;
    if (!p::is_reply(line) || !p::parse_reply(line, reply)) {
        return;
    }
    require(!reply.body.empty(), "a reply has a body", line);
    require(reply.id <= p::max_id, "its id is within its bounds", line);
    if (p::is_failure(reply.body)) {
        check_failure(reply.body);
    }

    std::string text;
    if (reply.progress) {
        require(reply.id != 0 && *reply.progress >= 0 && *reply.progress <= 1, "progress is part of a request's", line);
        p::append_progress_head(text, reply.id, *reply.progress);
    } else {
        p::append_reply_head(text, reply.id);
    }
    text.append(reply.body);
    p::reply_line again;
    require(p::is_reply(text) && p::parse_reply(text, again), "what is written can be read", text);
    require(again.id == reply.id && again.progress == reply.progress && again.body == reply.body, "it is the same",
            text);
}

} // namespace cles::fuzz
