// SPDX-License-Identifier: BSL-1.0
#include "config/yaml_value.hpp"

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include "config/config_values.hpp"

#include <string_view>

namespace cles::runtime {

config_node::config_node(const YAML::Node& value, std::string key, const std::string& file,
                         std::map<std::string, std::string>& origins)
    : value_(value), key_(std::move(key)), file_(file), origins_(origins) {
    if (!key_.empty()) {
        origins_[key_] = place();
    }
}

const std::string& config_node::text() const {
    if (value_.IsNull()) {
        refuse("has no value");
    }
    if (!value_.IsScalar()) {
        refuse("has to be a single value");
    }
    return value_.Scalar();
}

void config_node::map(const readers& known) const {
    each_pair([&](const std::string& name, const config_node& value) {
        const auto found = known.find(name);
        if (found == known.end()) {
            std::string all;
            for (const auto& [key, unused] : known) {
                all.append(all.empty() ? "" : ", ").append(key);
            }
            value.refuse("unknown key; known here: " + all);
        }
        found->second(value);
    });
}

void config_node::names(const std::function<void(const std::string&, const config_node&)>& each) const {
    each_pair([&](const std::string& name, const config_node& value) {
        try {
            to_node_name(name);
        } catch (const bad_value& wrong) {
            value.refuse(wrong.what());
        }
        each(name, value);
    });
}

void config_node::list(const reader& each) const {
    if (!value_.IsSequence()) {
        refuse("has to be a list: [one, two]");
    }
    std::size_t at = 0;
    for (const auto& item : value_) {
        each({static_cast<const YAML::Node&>(item), key_ + "[" + std::to_string(at++) + "]", file_, origins_});
    }
}

std::string config_node::json() const {
    try {
        auto text = json_of(value_); // which refuses what nests without end
        keep_places(value_, key_);
        return text;
    } catch (const bad_value& wrong) {
        refuse(wrong.what());
    }
}

void config_node::keep_places(const YAML::Node& value, const std::string& key) const {
    constexpr std::size_t most = 10'000; // anchors may multiply what is there
    const auto keep = [&](const YAML::Node& inner, int line, const std::string& inner_key) {
        if (origins_.size() < most) {
            origins_[inner_key] = file_ + ":" + std::to_string(line + 1);
            keep_places(inner, inner_key);
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

void config_node::refuse(const std::string& why) const {
    throw config_error(key_.empty() ? place() : place() + ": " + key_, why);
}

void config_node::each_pair(const std::function<void(const std::string&, const config_node&)>& each) const {
    if (!value_.IsMap()) {
        refuse(value_.IsNull() ? "has no value" : "has to have keys of its own");
    }
    std::map<std::string, int> lines;
    for (const auto& pair : value_) {
        const auto& key = pair.first;
        if (!key.IsScalar()) {
            refuse("a key has to be a word");
        }
        const auto& name = key.Scalar();
        // A value that is missing has no line of its own.
        const config_node made{pair.second, key_.empty() ? name : key_ + "." + name, file_, origins_};
        const auto line = key.Mark().line + 1;
        origins_[made.key_] = file_ + ":" + std::to_string(line);
        if (const auto [first, is_new] = lines.emplace(name, line); !is_new) {
            made.refuse("is there already, in line " + std::to_string(first->second));
        }
        each(name, made);
    }
}

std::string config_node::place() const {
    if (const auto known = origins_.find(key_); !key_.empty() && known != origins_.end()) {
        return known->second;
    }
    const auto line = value_.Mark().line;
    return line < 0 ? file_ : file_ + ":" + std::to_string(line + 1);
}

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
