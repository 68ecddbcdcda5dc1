// SPDX-License-Identifier: BSL-1.0
#include "config/config_node.hpp"

#include "config/config_json.hpp"

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

} // namespace cles::runtime
