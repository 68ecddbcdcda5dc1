// SPDX-License-Identifier: BSL-1.0
#include "protocol/reply_line.hpp"

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>
#include <cles/printable.hpp>

#include "protocol/grammar.hpp"
#include "protocol/request_line.hpp"

namespace cles::protocol {

bool begins_with_error(std::string_view body) {
    const auto second = body.size() > 3 && body[1] == '"' ? body[2] : '\\';
    if (!body.starts_with('{') || (second != 'e' && second != '\\')) {
        return false; // most bodies
    }
    json_reader reader{body};
    std::string_view key;
    return reader.begin_object() && reader.next_key(key) && key == "error";
}

bool parse_reply(std::string_view line, reply_line& out) noexcept {
    if (!line.starts_with("id=")) {
        out.body = line;
        return true;
    }
    part_reader parts{line};
    const auto id = number_between(parts.next().substr(3), 1, max_id);
    if (!id) {
        return false;
    }
    out.id = *id;
    std::optional<std::uint64_t> seq;
    std::optional<std::uint32_t> epoch;
    for (auto part = parts.next(); !part.empty(); part = parts.next()) {
        adverb a;
        if (!split_adverb(part, a)) {
            return false;
        }
        if (a.key == "seq") {
            seq = number_between(a.value, 1, max_id);
        } else if (a.key == "epoch") {
            epoch = parse_epoch(a.value);
        } else if (a.key == "grant") {
            out.grant = parse_grant(a.value).value_or(0);
        } else if (a.key == "progress") {
            double fraction = -1;
            if (out.progress || !json_detail::read_number(a.value, fraction) || !(fraction >= 0 && fraction <= 1)) {
                return false;
            }
            out.progress = fraction;
        } else if (a.key == "id") {
            return false;
        }
    }
    if (seq && epoch) {
        out.mark = update_mark{.seq = *seq, .epoch = *epoch};
    }
    out.body = parts.rest();
    return !out.body.empty();
}

bool parse_failure(std::string_view body, failure& out) {
    json_reader reader{body};
    std::string_view key;
    reader.begin_object();
    while (reader.next_key(key)) {
        if (key == "error" && reader.peek() == json_reader::kind::string) {
            std::string_view name;
            if (reader.read(name)) {
                out.code = errc_from_wire(name);
            }
        } else if (key == "message" && reader.peek() == json_reader::kind::string) {
            std::string_view text;
            if (reader.read(text)) {
                out.message = printable(text); // programs show it
            }
        } else if (key == "node" && reader.peek() == json_reader::kind::string) {
            reader.read(out.node);
        } else if (key == "challenge" && reader.peek() == json_reader::kind::string) {
            reader.read(out.challenge);
        } else if (key == "retry_ms" && reader.peek() == json_reader::kind::number) {
            std::string_view raw;
            if (reader.read_raw(raw)) {
                out.retry_ms = parse_number(raw);
            }
        } else if (key == "ran" && reader.peek() == json_reader::kind::boolean) {
            reader.read(out.ran);
        } else {
            reader.skip();
        }
    }
    return reader.at_end();
}

std::string failure_text(const failure& f) {
    std::string text;
    append_failure(text, f);
    return text;
}

void append_failure(std::string& out, const failure& f) {
    if (!f.answer.empty()) {
        out.append(f.answer);
        return;
    }
    json_writer writer{out};
    writer.begin_object();
    writer.key("error");
    writer.value(wire_name(f.code));
    writer.key("message");
    writer.value(std::string_view{f.message});
    if (f.ran) {
        writer.key("ran");
        writer.value(true);
    }
    if (f.retry_ms || f.code == errc::busy) {
        writer.key("retry_ms");
        writer.value(f.retry_ms.value_or(default_retry_ms));
    }
    if (!f.node.empty()) {
        writer.key("node");
        writer.value(std::string_view{f.node});
        writer.key("challenge");
        writer.value(std::string_view{f.challenge});
    }
    writer.end_object();
}

void append_reply_head(std::string& out, std::uint64_t id) {
    if (id != 0) {
        out.append("id=");
        append_number(out, id);
        out.push_back(' ');
    }
}

std::string mark_text(const std::optional<update_mark>& mark) {
    return mark ? "seq=" + std::to_string(mark->seq) + " epoch=" + epoch_text(mark->epoch) : std::string{};
}

void append_progress_head(std::string& out, std::uint64_t id, double fraction) {
    out.append("id=");
    append_number(out, id);
    out.append(" progress=");
    append_number(out, fraction);
    out.push_back(' ');
}

} // namespace cles::protocol
