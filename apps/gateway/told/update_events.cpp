// SPDX-License-Identifier: BSL-1.0
#include "gateway/told/update_events.hpp"

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include "gateway/http/message.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>

namespace gateway {
namespace {

constexpr std::size_t epoch_digits = 8;

std::string epoch_text(std::uint32_t epoch) {
    std::array<char, epoch_digits> digits{};
    const auto written = std::to_chars(digits.data(), digits.data() + digits.size(), epoch, 16);
    const std::string_view text{digits.data(), static_cast<std::size_t>(written.ptr - digits.data())};
    return std::string(epoch_digits - text.size(), '0').append(text);
}

// {"node":"car1","update":VALUE}
std::string of_node(std::string_view node, std::string_view key, std::string_view json) {
    auto out = R"({"node":)" + json_string(node) + ",\"";
    return out.append(key).append("\":").append(json).append("}");
}

// The values, or failures, in the reply to a BIND of `all`: an event for each node.
void append_parts(std::string& out, cles::json_reader& r, std::string_view type, std::string_view key) {
    std::string_view name;
    bool good = r.begin_object();
    while (good && r.next_key(name)) {
        const std::string node{name};
        std::string_view raw;
        good = r.read_raw(raw);
        if (good && raw != "{}") { // nothing has been published
            append_event(out, type, {}, of_node(node, key, raw));
        }
    }
}

void append_reply_of_all(std::string& out, std::string_view json) {
    cles::json_reader r{json, cles::json_writer::most_levels};
    std::string_view key;
    bool good = r.begin_object();
    while (good && r.next_key(key)) {
        if (key == "results") {
            append_parts(out, r, {}, "update");
        } else if (key == "errors") {
            append_parts(out, r, "failure", "failure");
        } else {
            r.skip();
        }
        good = r.ok();
    }
}

} // namespace

// Line feeds and carriage returns separate the lines of an event. In JSON, they are between values only.
void append_event(std::string& out, std::string_view type, std::string_view id, std::string_view data) {
    if (!id.empty()) {
        out.append("id: ").append(id).append("\n");
    }
    if (!type.empty()) {
        out.append("event: ").append(type).append("\n");
    }
    out.append("data: ");
    const auto from = out.size();
    out.append(data);
    std::replace_if(
        out.begin() + static_cast<std::ptrdiff_t>(from), out.end(), [](char c) { return c == '\n' || c == '\r'; }, ' ');
    out.append("\n\n");
}

std::string event_id_of(const cles::update_mark& mark) {
    return epoch_text(mark.epoch) + "." + std::to_string(mark.seq);
}

std::optional<cles::update_mark> mark_in(std::string_view event_id) noexcept {
    const auto dot = std::min(event_id.find('.'), event_id.size());
    const auto epoch = event_id.substr(0, dot);
    const auto seq = event_id.substr(std::min(dot + 1, event_id.size()));
    cles::update_mark found;
    const auto read = [](std::string_view text, auto& into, int base) {
        const auto* const end = text.data() + text.size();
        const auto [rest, code] = std::from_chars(text.data(), end, into, base);
        return code == std::errc{} && rest == end;
    };
    const bool good = epoch.size() == epoch_digits && read(epoch, found.epoch, 16) && read(seq, found.seq, 10);
    return good ? std::optional{found} : std::nullopt;
}

void update_events::take(const cles::feed_item<cles::json_text>& item, std::string& out) {
    if (item.has_value()) {
        take_value(item, out);
        return;
    }
    switch (item.kind) {
    case cles::feed_event::current:
    case cles::feed_event::update: return; // values
    case cles::feed_event::gap: {
        const bool is_named = is_of_all_ && !item.publisher.empty();
        const auto of = is_named ? R"(,"node":)" + json_string(item.publisher) : std::string{};
        append_event(out, "gap", {}, R"({"missed":)" + std::to_string(item.missed) + of + "}");
        return;
    }
    case cles::feed_event::lost: append_event(out, "lost", {}, R"({"reason":)" + json_string(item.text) + "}"); return;
    case cles::feed_event::rebound: append_event(out, "rebound", {}, "{}"); return;
    }
}

void update_events::take_value(const cles::feed_item<cles::json_text>& item, std::string& out) {
    if (is_of_all_) {
        if (item.kind == cles::feed_event::current) {
            append_reply_of_all(out, item.value.text);
        } else {
            append_event(out, {}, {}, of_node(item.publisher, "update", item.value.text));
        }
        return;
    }
    if (item.seq == 0) { // its publisher does not tell which update it is
        append_event(out, {}, {}, item.value.text);
        return;
    }
    const cles::update_mark mark{.seq = item.seq, .epoch = item.epoch};
    const bool is_same_run = last_ && last_->epoch == mark.epoch;
    if (is_same_run && mark.seq <= last_->seq) {
        return;
    }
    if (last_ && !is_same_run) {
        append_event(out, "restart", {}, R"({"epoch":")" + epoch_text(mark.epoch) + "\"}");
    } else if (is_same_run && !is_thinned_ && mark.seq > last_->seq + 1 &&
               (is_first_ || item.kind == cles::feed_event::current)) { // a gap between updates is an event of its own
        append_event(out, "gap", {}, R"({"missed":)" + std::to_string(mark.seq - last_->seq - 1) + "}");
    }
    last_ = mark;
    is_first_ = false;
    append_event(out, {}, event_id_of(mark), item.value.text);
}

} // namespace gateway
