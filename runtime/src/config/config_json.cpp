// SPDX-License-Identifier: BSL-1.0
#include "config/config_json.hpp"

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include "config/config_values.hpp"

#include <string_view>

namespace cles::runtime {
namespace {

constexpr int deepest = 32;
constexpr std::size_t longest = 1U << 20U;

bool is_number(const std::string& text) {
    const bool begins_so = !text.empty() && (text[0] == '-' || (text[0] >= '0' && text[0] <= '9'));
    return begins_so && is_valid_json("[" + text + "]");
}

void write_scalar(json_writer& w, const YAML::Node& value) {
    const auto& text = value.Scalar();
    const bool quoted = value.Tag() == "!";
    if (!quoted && (text == "true" || text == "false")) {
        w.value(text == "true");
    } else if (!quoted && is_number(text)) {
        w.raw(text);
    } else {
        w.value(std::string_view{text});
    }
}

// The bounds end what anchors may multiply, or turn into a ring.
void write(json_writer& w, const std::string& out, const YAML::Node& value, int depth) {
    if (depth > deepest) {
        throw bad_value("nests deeper than " + std::to_string(deepest));
    }
    if (out.size() > longest) {
        throw bad_value("is more than " + std::to_string(longest) + " bytes of JSON");
    }
    if (value.IsMap()) {
        w.begin_object();
        for (const auto& pair : value) {
            if (!pair.first.IsScalar()) {
                throw bad_value("holds a key that is no word");
            }
            w.key(pair.first.Scalar());
            write(w, out, pair.second, depth + 1);
        }
        w.end_object();
    } else if (value.IsSequence()) {
        w.begin_array();
        for (const auto& inner : value) {
            write(w, out, inner, depth + 1);
        }
        w.end_array();
    } else if (value.IsScalar()) {
        write_scalar(w, value);
    } else {
        w.null();
    }
}

} // namespace

std::string json_of(const YAML::Node& value) {
    if (value.IsNull()) {
        return "{}";
    }
    if (!value.IsMap() && !value.IsSequence()) {
        throw bad_value("has to have keys of its own, or be a list");
    }
    std::string out;
    json_writer w{out};
    write(w, out, value, 1);
    return out;
}

} // namespace cles::runtime
