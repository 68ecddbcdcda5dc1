// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>

#include <cstddef>
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

// The path to what stands at `at` of compact JSON that may end anywhere behind it, as "route[2].name".
std::string path_to(std::string_view json, std::size_t at) {
    std::vector<level> levels;
    for (std::size_t i = 0; i < at; ++i) {
        switch (json[i]) {
        case '{': levels.push_back({.is_object = true}); break;
        case '[': levels.push_back({}); break;
        case '}':
        case ']': levels.pop_back(); break;
        case ',': ++levels.back().index; break;
        case '"': {
            const auto begin = i + 1;
            while (++i < json.size() && json[i] != '"') {
                i += json[i] == '\\' ? 1 : 0;
            }
            if (i < at && i + 1 < json.size() && json[i + 1] == ':') {
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

void throw_broken_text(const json_writer& w) {
    const auto path = path_to(w.written(), w.broken_text());
    throw error(errc::conversion, path + (path.empty() ? "" : ": ") + "text that is not UTF-8");
}

bool fail_count(json_reader& r, std::string_view which, std::size_t wanted) {
    return r.fail(std::string{which} + " than " + std::to_string(wanted) + " elements");
}

void write_text(json_writer& w, std::string_view json) {
    std::string why;
    if (!is_valid_json(json, 32, &why)) {
        throw error(errc::conversion, "the text to send is not JSON: " + why);
    }
    std::string compact;
    append_compact_json(json, compact);
    w.raw(compact);
}

} // namespace cles::detail
