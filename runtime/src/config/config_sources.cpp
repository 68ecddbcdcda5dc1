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

std::vector<std::string> parts_of(std::string_view text) {
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
void take(const std::optional<overrides::given<T>>& from, config& over, const std::string& key, F use) {
    if (!from) {
        return;
    }
    // What the file said of the key and its parts counts no more.
    std::erase_if(over.origins, [&](const auto& origin) {
        const auto& known = origin.first;
        return known.starts_with(key) &&
               (known.size() == key.size() || known[key.size()] == '[' || known[key.size()] == '.');
    });
    over.origins[key] = from->by;
    try {
        use(from->value);
    } catch (const bad_value& wrong) {
        throw config_error(from->by, wrong.what());
    }
}

std::vector<std::string> urls(const std::vector<std::string>& texts, config& over, const std::string& key) {
    std::vector<std::string> all;
    for (const auto& text : texts) {
        over.origins[key + "[" + std::to_string(all.size()) + "]"] = over.origins[key];
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
    const auto several = [](const char* value) { return parts_of(value); };
    text("CLES_NODE", found.node, whole);
    text("CLES_POOL", found.pool, whole);
    text("CLES_LISTEN", found.listen, several);
    text("CLES_SEEDS", found.seeds, several);
    text("CLES_MULTICAST", found.multicast, whole);
    text("CLES_LOG", found.log, whole);
    return found;
}

void apply(const overrides& wanted, config& over) {
    take(wanted.node, over, "node", [&](const std::string& text) { over.node = to_node_name(text); });
    take(wanted.pool, over, "pool", [&](const std::string& text) { over.pool = to_pool_name(text); });
    take(wanted.allow_clash, over, "allow_clash", [&](bool value) { over.allow_clash = value; });
    take(wanted.listen, over, "listen",
         [&](const std::vector<std::string>& texts) { over.listen = urls(texts, over, "listen"); });
    take(wanted.seeds, over, "seeds",
         [&](const std::vector<std::string>& texts) { over.seeds = urls(texts, over, "seeds"); });
    take(wanted.multicast, over, "multicast", [&](const std::string& text) { over.multicast = to_multicast(text); });
    take(wanted.log, over, "log", [&](const std::string& text) { over.log = to_log(text, over.log); });
}

namespace {

std::string value_of(const std::function<const char*(const char*)>& variable, const char* name) {
    const char* value = variable(name);
    return value == nullptr ? "" : value;
}

// One that was named has to be there; of the usual places, one that is there but cannot be read is not passed over.
std::string file_of(const config_sources& from) {
    if (from.file) {
        return *from.file;
    }
    if (auto named = value_of(from.variable, "CLES_CONFIG"); !named.empty()) {
        return named;
    }
    for (auto& place : usual_places(from.variable)) {
        if (::access(place.c_str(), F_OK) == 0) {
            return std::move(place);
        }
    }
    return {};
}

} // namespace

std::vector<std::string> usual_places(const std::function<const char*(const char*)>& variable) {
    std::vector<std::string> places{"./clesd.yaml"};
    if (const auto own = value_of(variable, "XDG_CONFIG_HOME"); !own.empty()) {
        places.push_back(own + "/cles/clesd.yaml");
    } else if (const auto home = value_of(variable, "HOME"); !home.empty()) {
        places.push_back(home + "/.config/cles/clesd.yaml");
    }
    places.emplace_back("/etc/cles/clesd.yaml");
    return places;
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
