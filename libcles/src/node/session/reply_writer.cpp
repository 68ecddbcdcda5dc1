// SPDX-License-Identifier: BSL-1.0
#include "node/session/reply_writer.hpp"

#include "node/tracing/span_recorder.hpp"

#include <algorithm>

namespace cles::core {
namespace {

constexpr std::size_t max_escape = 6;     // "\u0000"
constexpr std::size_t always_fits = 1024; // a failure in its place would take about as much
constexpr std::string_view done_outcome = "ok";
constexpr std::size_t head_bytes = 24; // times max_escape: the bytes around a failure's message

// Truncates text without splitting a character.
void cut(std::string& text, std::size_t longest) {
    if (text.size() > longest) {
        while (longest != 0 && (static_cast<unsigned char>(text[longest]) & 0xC0U) == 0x80U) {
            --longest;
        }
        text.resize(longest);
    }
}

} // namespace

std::optional<protocol::failure> close_result(std::string& out, std::size_t start) {
    close_body(out, start);
    if (protocol::begins_with_error(std::string_view{out}.substr(start))) {
        return protocol::failure{.code = errc::failed, .message = "the result's first key is 'error'"};
    }
    return std::nullopt;
}

reply_writer::reply_writer(node_state& host, line_sink& out) noexcept
    : node_(host), out_(out),
      max_reply_(out.is_datagram() ? std::min(host.bounds.line, out.datagram() - 1) : host.bounds.line) {}

void reply_writer::note(reply_target where, std::string_view reply, std::string_view outcome) {
    if (where.span != 0 && node_.spans) {
        node_.spans->end(where.span, outcome, node_.time.now());
    }
    if (seen_ != nullptr && where.id != 0 && !where.apart && !seen_->empty()) {
        seen_->set_reply(where.id, reply, node_.time.now());
    }
}

void reply_writer::done(reply_target where, std::string_view body, std::string_view head) {
    std::string text;
    protocol::append_reply_head(text, where.id);
    if (where.id != 0 && !head.empty()) {
        text.append(head).push_back(' ');
    }
    const auto at = text.size();
    text.append(body);
    send(where, text, at);
}

void reply_writer::send(reply_target where, std::string& text, std::size_t body) {
    if (const auto why = close_result(text, body)) {
        fail(where, *why);
    } else if (text.size() > max_reply_) {
        fail(where,
             {.code = errc::too_large,
              .message = node_.name + ": the answer has " + std::to_string(text.size()) + " bytes, the limit is " +
                         std::to_string(max_reply_) + (out_.is_datagram() ? " by datagram: use TCP" : " (limits.line)"),
              .ran = true});
    } else if (where.wanted && text.size() > always_fits && !where.reserved && !out_.reserve(text.size() + 1)) {
        fail(where, {.code = errc::busy,
                     .message = node_.name + ": no memory is left for the answer's " + std::to_string(text.size()) +
                                " bytes (limits.memory)",
                     .retry_ms = 1000,
                     .ran = true});
    } else if (where.wanted) {
        text.push_back('\n');
        output_for(where).append(text);
        note(where, text, done_outcome);
    } else {
        note(where, {}, done_outcome);
    }
}

void reply_writer::fail(reply_target where, const protocol::failure& why) {
    if (!where.wanted) {
        ++(where.housekeeping ? node_.counts.housekeeping_errors : node_.counts.errors_unsent);
        note(where, {}, wire_name(why.code));
        return;
    }
    ++(where.housekeeping ? node_.counts.housekeeping_errors : node_.counts.errors);
    auto reported = why;
    // A handler's message does not name the node.
    if (reported.answer.empty() && !reported.message.starts_with(node_.name)) {
        reported.message.insert(0, node_.name + ": ");
    }
    auto& out = output_for(where);
    const auto line = out.size();
    protocol::append_reply_head(out, where.id);
    const auto body = out.size();
    protocol::append_failure(out, reported);
    if (out.size() - line > max_reply_) { // a handler's message may be long; the peer would close the link over it
        out.resize(body);
        reported.answer.clear();
        cut(reported.message, max_reply_ / max_escape > head_bytes ? max_reply_ / max_escape - head_bytes : 0);
        protocol::append_failure(out, reported);
    }
    out.push_back('\n');
    note(where, std::string_view{out}.substr(line), wire_name(why.code));
}

void reply_writer::progress(reply_target where, double fraction, std::string_view json) {
    auto& out = output_for(where);
    const auto line = out.size();
    protocol::append_progress_head(out, where.id, fraction);
    const auto body = out.size();
    out.append(json);
    close_body(out, body);
    if (out.size() - line > max_reply_) {
        out.replace(body, out.size() - body, "{}");
    }
    out.push_back('\n');
}

} // namespace cles::core
