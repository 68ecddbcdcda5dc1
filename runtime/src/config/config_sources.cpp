// SPDX-License-Identifier: BSL-1.0
#include "config/config_sources.hpp"

#include "config/config_file.hpp"

#include <unistd.h>

namespace cles::runtime {
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
