// SPDX-License-Identifier: BSL-1.0
#include "config/config_sources.hpp"

#include "config/config.hpp"
#include "config/config_file.hpp"
#include "config/config_values.hpp"

#include <algorithm>
#include <string_view>

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

template <class T, class F>
void apply_override(const std::optional<overrides::given<T>>& from, config& into, const std::string& key, F use) {
    if (!from) {
        return;
    }
    // The file's values of the key and its parts are replaced.
    std::erase_if(into.origins, [&](const auto& origin) {
        const auto& known = origin.first;
        return known.starts_with(key) &&
               (known.size() == key.size() || known[key.size()] == '[' || known[key.size()] == '.');
    });
    into.origins[key] = from->source;
    try {
        use(from->value);
    } catch (const invalid_value& e) {
        throw config_error(from->source, e.what());
    }
}

std::vector<std::string> urls(const std::vector<std::string>& texts, config& into, const std::string& key) {
    std::vector<std::string> all;
    for (const auto& text : texts) {
        into.origins[key + "[" + std::to_string(all.size()) + "]"] = into.origins[key];
        all.push_back(to_url(text));
    }
    return all;
}

} // namespace

overrides from_environment(const std::function<const char*(const char*)>& variable) {
    overrides found;
    const auto text = [&](const char* name, auto& to, auto read) {
        if (const char* value = variable(name); value != nullptr && *value != '\0') {
            to = {read(value), name};
        }
    };
    const auto whole = [](const char* value) { return std::string{value}; };
    const auto several = [](const char* value) { return split_list(value); };
    text("CLES_NODE", found.node, whole);
    text("CLES_POOL", found.pool, whole);
    text("CLES_LISTEN", found.listen, several);
    text("CLES_SEEDS", found.seeds, several);
    text("CLES_MULTICAST", found.multicast, whole);
    text("CLES_LOG", found.log, whole);
    return found;
}

void apply(const overrides& wanted, config& into) {
    apply_override(wanted.node, into, "node", [&](const std::string& text) { into.node = to_node_name(text); });
    apply_override(wanted.pool, into, "pool", [&](const std::string& text) { into.pool = to_pool_name(text); });
    apply_override(wanted.allow_clash, into, "allow_clash", [&](bool value) { into.allow_clash = value; });
    apply_override(wanted.listen, into, "listen",
                   [&](const std::vector<std::string>& texts) { into.listen = urls(texts, into, "listen"); });
    apply_override(wanted.seeds, into, "seeds",
                   [&](const std::vector<std::string>& texts) { into.seeds = urls(texts, into, "seeds"); });
    apply_override(wanted.multicast, into, "multicast",
                   [&](const std::string& text) { into.multicast = to_multicast(text); });
    apply_override(wanted.log, into, "log", [&](const std::string& text) { into.log = to_log_config(text, into.log); });
}

namespace {

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
    apply(from_environment(from.variable), made);
    apply(from.flags, made);
    check(made);
    return made;
}

} // namespace cles::runtime
