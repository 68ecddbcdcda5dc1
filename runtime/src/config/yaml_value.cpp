// SPDX-License-Identifier: BSL-1.0
#include "config/yaml_value.hpp"

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include "config/config_values.hpp"

#include <string_view>

namespace cles::runtime {

yaml_value::yaml_value(const YAML::Node& value, std::string key, const yaml_source& source)
    : value_(value), key_(std::move(key)), source_(source) {
    if (!key_.empty()) {
        source_.origins[key_] = location();
    }
}

const std::string& yaml_value::scalar() const {
    if (value_.IsNull()) {
        fail("has no value");
    }
    if (!value_.IsScalar()) {
        fail("has to be a single value");
    }
    return value_.Scalar();
}

void yaml_value::read_map(const readers& known) const {
    for_each_pair([&](const std::string& name, const yaml_value& value) {
        const auto found = known.find(name);
        if (found == known.end()) {
            std::string all;
            for (const auto& [key, unused] : known) {
                all.append(all.empty() ? "" : ", ").append(key);
            }
            value.fail("unknown key; known here: " + all);
        }
        found->second(value);
    });
}

void yaml_value::read_names(const std::function<void(const std::string&, const yaml_value&)>& each) const {
    for_each_pair([&](const std::string& name, const yaml_value& value) {
        value.checked([&] { return to_node_name(name); });
        each(name, value);
    });
}

void yaml_value::read_list(const reader& each) const {
    if (!value_.IsSequence()) {
        fail("has to be a list: [one, two]");
    }
    std::size_t at = 0;
    for (const auto& item : value_) {
        each({static_cast<const YAML::Node&>(item), key_ + "[" + std::to_string(at++) + "]", source_});
    }
}

std::string yaml_value::json() const {
    auto text = checked([&] { return yaml_to_json(value_); }); // throws if it is nested endlessly
    record_locations(value_, key_);
    return text;
}

void yaml_value::record_locations(const YAML::Node& value, const std::string& key) const {
    constexpr std::size_t max_locations = 10'000; // anchors may multiply the values
    const auto keep = [&](const YAML::Node& inner, int line, const std::string& inner_key) {
        if (source_.origins.size() < max_locations) {
            source_.origins[inner_key] = source_.name + ":" + std::to_string(line + 1);
            record_locations(inner, inner_key);
        }
    };
    if (value.IsMap()) {
        for (const auto& pair : value) {
            keep(pair.second, pair.first.Mark().line, key + "." + pair.first.Scalar());
        }
    } else if (value.IsSequence()) {
        std::size_t at = 0;
        for (const auto& item : value) {
            keep(item, item.Mark().line, key + "[" + std::to_string(at++) + "]");
        }
    }
}

void yaml_value::fail(const std::string& why) const {
    throw config_error(key_.empty() || !source_.is_file ? location() : location() + ": " + key_, why);
}

void yaml_value::for_each_pair(const std::function<void(const std::string&, const yaml_value&)>& each) const {
    if (!value_.IsMap()) {
        fail(value_.IsNull() ? "has no value" : "has to be a map");
    }
    std::map<std::string, int> lines;
    for (const auto& pair : value_) {
        const auto& key = pair.first;
        if (!key.IsScalar()) {
            fail("keys have to be scalars");
        }
        const auto& name = key.Scalar();
        // A missing value has no line.
        const yaml_value made{pair.second, key_.empty() ? name : key_ + "." + name, source_};
        const auto line = key.Mark().line + 1;
        source_.origins[made.key_] = source_.name + ":" + std::to_string(line);
        if (const auto [first, is_new] = lines.emplace(name, line); !is_new) {
            made.fail("is a duplicate of the key in line " + std::to_string(first->second));
        }
        each(name, made);
    }
}

std::string yaml_value::location() const {
    if (const auto known = source_.origins.find(key_); !key_.empty() && known != source_.origins.end()) {
        return known->second;
    }
    const auto line = value_.Mark().line;
    return line < 0 ? source_.name : source_.name + ":" + std::to_string(line + 1);
}

namespace {

constexpr int max_depth = 32;
constexpr std::size_t max_json_size = 1U << 20U;

bool is_number(const std::string& text) {
    const bool may_be_number = !text.empty() && (text[0] == '-' || (text[0] >= '0' && text[0] <= '9'));
    return may_be_number && is_valid_json("[" + text + "]");
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

// The limits stop anchors that multiply values or form a cycle.
void write(json_writer& w, const std::string& out, const YAML::Node& value, int depth) {
    if (depth > max_depth) {
        throw invalid_value("is nested deeper than " + std::to_string(max_depth) + " levels");
    }
    if (out.size() > max_json_size) {
        throw invalid_value("exceeds " + std::to_string(max_json_size) + " bytes of JSON");
    }
    if (value.IsMap()) {
        w.begin_object();
        for (const auto& pair : value) {
            if (!pair.first.IsScalar()) {
                throw invalid_value("contains a key that is not a scalar");
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

std::string yaml_to_json(const YAML::Node& value) {
    if (value.IsNull()) {
        return "{}";
    }
    if (!value.IsMap() && !value.IsSequence()) {
        throw invalid_value("has to be a map or a list");
    }
    std::string out;
    json_writer w{out};
    write(w, out, value, 1);
    return out;
}

} // namespace cles::runtime
