// SPDX-License-Identifier: BSL-1.0
#include "isolation/wire_line.hpp"

#include <cles/json_writer.hpp>

#include <algorithm>

namespace cles::runtime {
namespace {

constexpr std::string_view hex_digits = "0123456789ABCDEF";

bool is_plain(char c) noexcept {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '.' || c == '~' || c == '+';
}

void append_encoded(std::string& to, std::string_view text) {
    for (const char c : text) {
        if (is_plain(c)) {
            to.push_back(c);
        } else {
            const auto byte = static_cast<unsigned char>(c);
            to.push_back('%');
            to.push_back(hex_digits[byte >> 4U]);
            to.push_back(hex_digits[byte & 15U]);
        }
    }
}

std::optional<std::string> decode(std::string_view text) {
    std::string out;
    out.reserve(text.size());
    for (std::size_t i = 0; i < text.size(); ++i) {
        if (text[i] != '%') {
            out.push_back(text[i]);
            continue;
        }
        const auto high = i + 2 < text.size() ? hex_digits.find(text[i + 1]) : std::string_view::npos;
        const auto low = high != std::string_view::npos ? hex_digits.find(text[i + 2]) : std::string_view::npos;
        if (low == std::string_view::npos) {
            return std::nullopt;
        }
        out.push_back(static_cast<char>(high << 4U | low));
        i += 2;
    }
    return out;
}

// Takes the text up to the next space.
std::string_view take_word(std::string_view& rest) noexcept {
    const auto end = std::min(rest.find(' '), rest.size());
    const auto word = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    return word;
}

bool read_noun(std::string_view noun, wire_line& into) {
    constexpr std::string_view self = "self:";
    if (!noun.starts_with(self)) {
        return false;
    }
    noun.remove_prefix(self.size());
    const auto end = std::min(noun.find('/'), noun.size());
    into.task = noun.substr(0, end);
    noun.remove_prefix(end);
    while (!noun.empty()) {
        noun.remove_prefix(1);
        const auto next = std::min(noun.find('/'), noun.size());
        auto text = decode(noun.substr(0, next));
        if (!text) {
            return false;
        }
        into.parameters.push_back(std::move(*text));
        noun.remove_prefix(next);
    }
    return !into.task.empty();
}

bool read_adverb(std::string_view word, wire_line& into) {
    const auto sign = word.find('=');
    if (sign == 0 || sign == std::string_view::npos) {
        return false;
    }
    const auto key = word.substr(0, sign);
    auto value = decode(word.substr(sign + 1));
    if (!value) {
        return false;
    }
    if (key == "id") {
        into.id = to_number<std::uint64_t>(*value).value_or(0);
        return into.id != 0;
    }
    into.adverbs.emplace_back(key, std::move(*value));
    return true;
}

} // namespace

wire_line_writer::wire_line_writer(cles::verb verb, std::string_view task) : line_(to_string(verb)) {
    line_.append(" self:").append(task);
}

wire_line_writer::wire_line_writer(std::uint64_t id) : line_("id=" + std::to_string(id)) {}

wire_line_writer& wire_line_writer::parameter(std::string_view text) {
    line_.push_back('/');
    append_encoded(line_, text);
    return *this;
}

wire_line_writer& wire_line_writer::parameter(std::uint64_t number) { return parameter(std::to_string(number)); }

wire_line_writer& wire_line_writer::adverb(std::string_view key, std::string_view value) {
    line_.append(" ").append(key).push_back('=');
    append_encoded(line_, value);
    return *this;
}

wire_line_writer& wire_line_writer::adverb(std::string_view key, std::int64_t value) {
    return adverb(key, std::to_string(value));
}

std::string wire_line_writer::body(std::string_view json) {
    line_.append(" ").append(json).push_back('\n');
    return std::move(line_);
}

std::string_view wire_line::adverb(std::string_view key) const noexcept {
    const auto found = std::ranges::find(adverbs, key, [](const auto& each) { return each.first; });
    return found == adverbs.end() ? std::string_view{} : std::string_view{found->second};
}

std::optional<std::int64_t> wire_line::number(std::string_view key) const noexcept {
    return to_number<std::int64_t>(adverb(key));
}

std::uint64_t wire_line::number_at(std::size_t index) const noexcept {
    return index < parameters.size() ? to_number<std::uint64_t>(parameters[index]).value_or(0) : 0;
}

std::optional<wire_line> read_wire_line(std::string_view line) {
    wire_line read;
    auto rest = line;
    read.is_reply = line.starts_with("id=");
    if (!read.is_reply) {
        const auto verb = verb_from(take_word(rest));
        if (!verb || !read_noun(take_word(rest), read)) {
            return std::nullopt;
        }
        read.verb = *verb;
    }
    while (!rest.empty()) {
        if (rest.front() == '{' || rest.front() == '[') {
            read.body = rest;
            break;
        }
        if (!read_adverb(take_word(rest), read)) {
            return std::nullopt;
        }
    }
    return read;
}

// -- replies -------------------------------------------------------------------------------------------------------

std::string reply_body(std::string_view json) {
    if (json.empty()) {
        return "{}";
    }
    if (json.front() == '{' || json.front() == '[') {
        return std::string{json};
    }
    return R"({"value":)" + std::string{json} + "}";
}

std::string failure_body(const wire_failure& what) {
    std::string out;
    json_writer w{out};
    write_json(w, what); // not `to_json`, because the message may be any bytes
    return out;
}

std::optional<wire_failure> read_failure(std::string_view body) {
    if (!body.starts_with(R"({"error":)")) {
        return std::nullopt;
    }
    wire_failure read;
    if (!from_json(body, read)) {
        return wire_failure{.error = "failed", .message = "the process of the plugin sent an invalid failure"};
    }
    if (read.retry_ms) {
        read.retry_ms = std::clamp<std::int64_t>(*read.retry_ms, 0, 86'400'000);
    }
    return read;
}

} // namespace cles::runtime
