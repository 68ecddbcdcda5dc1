// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>

#include "json/json_scan.hpp"

#include <boost/container/small_vector.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace cles::detail {
namespace {

struct level {
    bool is_object = false;
    std::size_t index = 0;
    std::string_view key{};
};

// The path to position `at` of compact JSON, which may end anywhere after it, as "route[2].name".
std::string path_to(std::string_view json, std::size_t at) {
    std::vector<level> levels;
    for (std::size_t i = 0; i < at; ++i) {
        switch (json[i]) {
        case '{': levels.push_back({.is_object = true}); break;
        case '[': levels.push_back({}); break;
        case '}':
        case ']':
            if (!levels.empty()) { // what came through `raw` may be anything
                levels.pop_back();
            }
            break;
        case ',':
            if (!levels.empty()) {
                ++levels.back().index;
            }
            break;
        case '"': {
            const auto begin = i + 1;
            while (++i < json.size() && json[i] != '"') {
                i += json[i] == '\\' ? 1 : 0;
            }
            if (i < at && i + 1 < json.size() && json[i + 1] == ':' && !levels.empty()) {
                levels.back().key = json.substr(begin, i - begin);
            }
            break;
        }
        default: break;
        }
    }
    std::string path;
    for (const auto& l : levels) {
        if (l.is_object) {
            path.append(path.empty() ? "" : ".").append(l.key);
        } else {
            path.append("[").append(std::to_string(l.index)).append("]");
        }
    }
    return path;
}

// -- enums --

// The last enumerator of that value, whose name is not empty.
std::string_view enumerator_of(const enum_values& known, std::uint64_t value) noexcept {
    for (auto i = known.values.size(); i-- > 0;) {
        if (known.values[i] == value) {
            return known.names[i];
        }
    }
    return {};
}

bool find_value(const enum_values& known, std::string_view name, std::uint64_t& value) noexcept {
    const auto at = static_cast<std::size_t>(std::ranges::find(known.names, name) - known.names.begin());
    if (at == known.names.size()) {
        return false;
    }
    value = known.values[at];
    return true;
}

// Whether flags are combined. No reader takes negative numbers.
bool combines_flags(const enum_values& known, std::uint64_t value) noexcept {
    if (!known.has_union || (known.is_signed && static_cast<std::int64_t>(value) < 0)) {
        return false;
    }
    std::uint64_t contained = 0;
    for (const auto each : known.values) {
        contained |= (each & ~value) == 0 ? each : 0;
    }
    return contained == value;
}

std::string choices_of(const enum_values& known) {
    std::string choices;
    for (const auto choice : known.names) {
        choices.append(choices.empty() ? "" : ", ").append(choice);
    }
    return choices;
}

std::string text_of(const enum_values& known, std::uint64_t value) {
    return known.is_signed ? std::to_string(static_cast<std::int64_t>(value)) : std::to_string(value);
}

std::string nameless(const enum_values& known, std::uint64_t value) {
    return text_of(known, value) + " is none of " + choices_of(known);
}

// Only the text that is written for a number stands for it, so that no key has two texts.
template <class Number>
bool read_canonical(std::string_view text, Number& number) {
    return json_detail::read_number(text, number) && std::to_string(number) == text;
}

} // namespace

void check_written(const json_writer& w) {
    if (w.broken_text() != json_writer::npos) {
        const auto path = path_to(w.written(), w.broken_text());
        throw error(errc::conversion, path + (path.empty() ? "" : ": ") + "text that is not UTF-8");
    }
    std::string why;
    if (!is_valid_json(w.written(), w.max_depth(), &why)) {
        throw error(errc::conversion, "what was written is not JSON: " + why);
    }
    if (w.written().find('\n') != std::string_view::npos) { // it would end the line of a message
        throw error(errc::conversion, "what was written contains a line feed");
    }
}

void write_array(json_writer& w, const char* text, std::size_t size) {
    const std::string_view whole{text, size};
    w.value(whole.substr(0, whole.find('\0')));
}

namespace {

std::string range_text(double minimum, double maximum) {
    return "a number outside of its range, " + to_json(minimum) + " to " + to_json(maximum);
}

} // namespace

bool fail_range(json_reader& r, double minimum, double maximum) { return r.fail(range_text(minimum, maximum)); }

void throw_range(const json_writer& w, double minimum, double maximum) {
    const auto path = path_to(w.written(), w.written().size());
    throw error(errc::conversion, path + ": " + range_text(minimum, maximum));
}

double require_finite(double number, bool was_finite, std::string_view why) {
    if (was_finite && !is_finite(number)) {
        throw error(errc::conversion, std::string{why});
    }
    return number;
}

bool fail_count(json_reader& r, std::string_view which, std::size_t wanted) {
    return r.fail(std::string{which} + " than " + std::to_string(wanted) + " elements");
}

namespace {

bool read_field(json_reader& r, void* object, const field& which) {
    if (which.read(r, object)) {
        return true;
    }
    r.inside_member(which.name());
    return false;
}

// Those that follow in the order of the description. Returns the first one that does not, or that cannot be read.
std::size_t read_in_order(json_reader& r, void* object, std::span<const field> fields, std::size_t next) {
    while (next < fields.size() && r.next_key_is(fields[next].key) && read_field(r, object, fields[next])) {
        ++next;
    }
    return next;
}

} // namespace

// Usually all members arrive in order, and no others.
bool read_fields(json_reader& r, void* object, std::span<const field> fields) {
    if (!r.begin_object()) {
        return false;
    }
    auto next = read_in_order(r, object, fields, 0);
    std::string_view key;
    bool has_more = r.next_key(key);
    if (!has_more && next == fields.size()) {
        return r.ok();
    }
    boost::container::small_vector<bool, 64> seen(fields.size()); // more than most structs have
    std::fill_n(seen.data(), next, true);
    while (has_more) {
        const auto found = static_cast<std::size_t>(std::ranges::find(fields, key, &field::name) - fields.begin());
        if (found == fields.size()) {
            if (!r.skip()) {
                return false;
            }
        } else if (read_field(r, object, fields[found])) {
            seen[found] = true;
            next = found + 1;
        } else {
            return false;
        }
        const auto first = next;
        next = read_in_order(r, object, fields, first);
        std::fill_n(seen.data() + first, next - first, true);
        has_more = r.next_key(key);
    }
    if (!r.ok()) {
        return false;
    }
    for (std::size_t i = 0; i < fields.size(); ++i) {
        if (fields[i].required && !seen[i]) {
            r.fail("is missing");
            r.inside_member(fields[i].name());
            return false;
        }
    }
    return true;
}

void write_enum(json_writer& w, const enum_values& known, std::uint64_t value) {
    if (const auto name = enumerator_of(known, value); !name.empty()) {
        w.value(name);
    } else if (!combines_flags(known, value)) {
        const auto path = path_to(w.written(), w.written().size());
        throw error(errc::conversion, path + (path.empty() ? "" : ": ") + nameless(known, value));
    } else if (known.is_signed) {
        w.value(static_cast<std::int64_t>(value));
    } else {
        w.value(value);
    }
}

bool read_enum(json_reader& r, const enum_values& known, std::uint64_t& value) {
    if (r.peek() == json_reader::kind::number && known.has_union) {
        return r.read(value) && (combines_flags(known, value) || r.fail("a number that combines no flags"));
    }
    std::string_view name;
    return r.read(name) && (find_value(known, name, value) || r.fail("expected one of " + choices_of(known)));
}

std::string enum_key(const enum_values& known, std::uint64_t value) {
    if (const auto name = enumerator_of(known, value); !name.empty()) {
        return std::string{name};
    }
    if (!combines_flags(known, value)) {
        throw error(errc::conversion, nameless(known, value));
    }
    return text_of(known, value);
}

bool read_enum_key(json_reader& r, std::string_view key, const enum_values& known, std::uint64_t& value) {
    return find_value(known, key, value) ||
           (read_canonical(key, value) && enumerator_of(known, value).empty() && combines_flags(known, value)) ||
           r.fail("the key is not one of " + choices_of(known));
}

bool read_integer_key(json_reader& r, std::string_view text, std::int64_t& key) {
    return read_canonical(text, key) || r.fail("the key is not an integer");
}

bool read_integer_key(json_reader& r, std::string_view text, std::uint64_t& key) {
    return read_canonical(text, key) || r.fail("the key is not an integer of 0 or more");
}

std::size_t levels_around_scalar(std::string_view json, std::string_view& scalar) {
    json_reader r{json, std::string_view::npos}; // its depth has been checked, or is when it is sent
    std::size_t levels = 0;
    std::string_view key;
    for (; r.peek() == json_reader::kind::object; ++levels) {
        if (!r.begin_object() || !r.next_key(key) || key != "value") {
            return 0;
        }
    }
    if (levels == 0 || r.peek() == json_reader::kind::array || !r.read_raw(scalar)) {
        return 0;
    }
    for (auto open = levels; open != 0; --open) {
        if (r.next_key(key)) {
            return 0;
        }
    }
    return r.at_end() ? levels : 0;
}

void write_text(json_writer& w, std::string_view json) {
    std::string why;
    if (!is_valid_json(json, std::min<std::size_t>(w.levels_left(), 32), &why)) {
        throw error(errc::conversion, "the text to send is not JSON: " + why);
    }
    std::string compact;
    append_compact_json(json, compact);
    w.checked(compact);
}

} // namespace cles::detail

namespace cles {

void converter<const char*>::write(json_writer& w, const char* value) {
    if (value == nullptr) {
        w.null();
    } else {
        w.value(std::string_view{value});
    }
}

} // namespace cles
