// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>

#include <boost/container/small_vector.hpp>

#include <algorithm>
#include <cstddef>
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

double require_finite(double number, bool was_finite, std::string_view why) {
    if (was_finite && !is_finite(number)) {
        throw error(errc::conversion, std::string{why});
    }
    return number;
}

bool fail_count(json_reader& r, std::string_view which, std::size_t wanted) {
    return r.fail(std::string{which} + " than " + std::to_string(wanted) + " elements");
}

bool read_fields(json_reader& r, void* object, std::span<const field> fields) {
    boost::container::small_vector<bool, 64> seen(fields.size()); // more than most structs have
    std::size_t next = 0;                                         // members usually arrive in order
    std::string_view key;
    if (!r.begin_object()) {
        return false;
    }
    for (;;) {
        if (next < fields.size() && r.next_key_is(fields[next].name)) {
            // as expected
        } else if (!r.next_key(key)) {
            break;
        } else {
            next = static_cast<std::size_t>(std::ranges::find(fields, key, &field::name) - fields.begin());
        }
        if (next == fields.size()) {
            if (!r.skip()) {
                return false;
            }
            continue;
        }
        if (!fields[next].read(r, object)) {
            r.inside_member(fields[next].name);
            return false;
        }
        seen[next++] = true;
    }
    if (!r.ok()) {
        return false;
    }
    for (std::size_t i = 0; i < fields.size(); ++i) {
        if (fields[i].required && !seen[i]) {
            r.fail("is missing");
            r.inside_member(fields[i].name);
            return false;
        }
    }
    return true;
}

bool read_choice(json_reader& r, std::span<const std::string_view> names, std::size_t& index) {
    std::string_view name;
    if (!r.read(name)) {
        return false;
    }
    index = static_cast<std::size_t>(std::ranges::find(names, name) - names.begin());
    if (index != names.size()) {
        return true;
    }
    std::string choices;
    for (const auto choice : names) {
        choices.append(choices.empty() ? "" : ", ").append(choice);
    }
    return r.fail("expected one of " + choices);
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
