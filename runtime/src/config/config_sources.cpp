// SPDX-License-Identifier: BSL-1.0
#include "config/config_sources.hpp"

#include "config/config.hpp"
#include "config/config_file.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

#include <unistd.h>

namespace cles::runtime {
namespace {

std::vector<std::string> split_list(std::string_view text) {
    std::vector<std::string> parts;
    while (!text.empty()) {
        const auto comma = text.find(',');
        auto part = text.substr(0, comma);
        part.remove_prefix(std::min(part.find_first_not_of(' '), part.size()));
        part.remove_suffix(part.size() - (part.find_last_not_of(' ') + 1));
        if (!part.empty()) {
            parts.emplace_back(part);
        }
        text.remove_prefix(comma == std::string_view::npos ? text.size() : comma + 1);
    }
    return parts;
}

std::string value_of(const std::function<const char*(const char*)>& variable, const char* name) {
    const char* value = variable(name);
    return value == nullptr ? "" : value;
}

// A file that is named has to exist. A file in a default location that exists but cannot be read is an error.
std::string file_of(const config_sources& from) {
    if (from.file) {
        return *from.file;
    }
    if (auto named = value_of(from.variable, "CLES_CONFIG"); !named.empty()) {
        return named;
    }
    for (auto& location : default_locations(from.variable)) {
        if (::access(location.c_str(), F_OK) == 0) {
            return std::move(location);
        }
    }
    return {};
}

} // namespace

overrides from_environment(const std::function<const char*(const char*)>& variable) {
    overrides found;
    const auto read = [&](const char* name, const char* key, bool is_list = false) {
        if (const auto text = value_of(variable, name); !text.empty()) {
            found.push_back({key, is_list ? split_list(text) : std::vector{text}, name});
        }
    };
    read("CLES_NODE", "node");
    read("CLES_POOL", "pool");
    read("CLES_LISTEN", "listen", true);
    read("CLES_SEEDS", "seeds", true);
    read("CLES_MULTICAST", "multicast");
    read("CLES_KEYS", "security");
    read("CLES_LOG", "log");
    return found;
}

std::vector<std::string> default_locations(const std::function<const char*(const char*)>& variable) {
    std::vector<std::string> locations{"./clesd.yaml"};
    if (const auto own = value_of(variable, "XDG_CONFIG_HOME"); !own.empty()) {
        locations.push_back(own + "/cles/clesd.yaml");
    } else if (const auto home = value_of(variable, "HOME"); !home.empty()) {
        locations.push_back(home + "/.config/cles/clesd.yaml");
    }
    locations.emplace_back("/etc/cles/clesd.yaml");
    return locations;
}

config load(const config_sources& from) {
    auto made = default_config(from.host, from.cores);
    if (const auto file = file_of(from); !file.empty()) {
        read_config_file(file, made);
    }
    apply_overrides(from_environment(from.variable), made);
    apply_overrides(from.flags, made);
    apply_security_defaults(made);
    if (made.security.is_on() && !made.origins.contains("node") && from.name_of_key) {
        if (auto name = from.name_of_key(made.security.keys); !name.empty()) {
            made.node = std::move(name);
        }
    }
    check(made);
    return made;
}

} // namespace cles::runtime
