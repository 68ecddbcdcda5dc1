// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_setup.hpp"

#include "config/config_error.hpp"
#include "plugins/plugin_places.hpp"
#include "plugins/plugin_search.hpp"
#include "plugins/plugin_trial.hpp"

#include <chrono>

namespace cles::runtime {
namespace {

// How long a plugin may take to be loaded and to look at its settings.
constexpr std::chrono::seconds trial_limit{10};

} // namespace

std::string complaint_about(const config& setup, std::size_t plugin, const plugin_error& why) {
    const auto of = "plugins[" + std::to_string(plugin) + "]";
    const auto& setting = why.setting();
    const auto key = !setting ? of + ".path" : setting->empty() ? of + ".config" : of + ".config." + *setting;
    return setup.place_of(key) + ": " + why.what();
}

void try_plugins(config& setup) {
    for (std::size_t i = 0; i < setup.plugins.size(); ++i) {
        auto& wanted = setup.plugins[i];
        try {
            const auto path = plugin_file(setup, wanted);
            try_plugin(path, find_plugin(path, plugin_folders(setup)), setup.node, wanted.config, trial_limit);
        } catch (const plugin_error& wrong) {
            wanted.unusable = complaint_about(setup, i, wrong);
            if (wanted.required) {
                throw config_error(wanted.unusable);
            }
        }
    }
}

} // namespace cles::runtime
