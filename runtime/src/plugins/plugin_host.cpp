// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_host.hpp"

#include <cles/error.hpp>
#include <cles/plugin_abi.h>
#include <cles/plugin_text.hpp>

#include "plugins/plugin_library.hpp"
#include "plugins/plugin_trial.hpp"

#include <algorithm>
#include <atomic>
#include <future>
#include <mutex>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

namespace cles::runtime {

struct plugin_host::state {
    plugin_jobs jobs;
    stop_notifier notifier; ///< for inline jobs; a pool has its own
    std::vector<std::unique_ptr<loaded_plugin>> plugins;
    std::vector<std::shared_ptr<const boost::dll::shared_library>> libraries;
    std::vector<const cles_plugin*> descriptions; ///< of the loaded ones, to detect duplicates
    std::atomic<std::size_t> callbacks_left{0};   ///< set by the thread that stops them
};

plugin_host::plugin_host(plugin_host_options options)
    : options_(std::move(options)), state_(std::make_shared<state>()) {
    // The plugins of all hosts are kept until the process ends, because a host cannot know whether a plugin is idle.
    static std::mutex mutex;
    static auto* const all = new std::vector<std::shared_ptr<state>>;
    const std::scoped_lock lock{mutex};
    all->push_back(state_);
}

plugin_host::~plugin_host() { stop(std::chrono::seconds{2}); }

void plugin_host::load(const std::string& path, const std::string& config, registrar& into, const std::string& sha256) {
    const plugin_file file{path, find_plugin(path, options_.rules.folders), options_.rules, sha256};
    if (options_.trial.count() > 0) {
        try_plugin(path, file, options_.node, config, options_.trial);
    }
    auto library = open_library(path, file);
    const auto& described = describe_plugin(path, *library);
    if (std::find(state_->descriptions.begin(), state_->descriptions.end(), &described) != state_->descriptions.end()) {
        throw plugin_error(path, "it is already loaded");
    }
    auto owned = std::make_unique<loaded_plugin>(detail::known_part(&described), options_.node, state_->jobs,
                                                 state_->notifier, options_.log);
    auto& plugin = *owned;
    state_->libraries.push_back(std::move(library));
    state_->plugins.push_back(std::move(owned));
    state_->descriptions.push_back(&described);

    const auto owner_of = [this](cles::verb verb, std::string_view task) -> std::optional<std::string> {
        const auto wanted = std::string{to_string(verb)} + " " + std::string{task};
        for (const auto& p : plugins_) {
            if (std::find(p.tasks.begin(), p.tasks.end(), wanted) != p.tasks.end()) {
                return "the plugin '" + p.name + "' (" + p.path + ")";
            }
        }
        return std::nullopt;
    };
    if (const auto refused = plugin.start(config, into.make_publisher(), owner_of)) {
        throw plugin_error(path, refused->why, refused->key);
    }
    plugin_info info{.path = path, .name = plugin.name(), .version = plugin.version()};
    try {
        for (auto& task : plugin.take_tasks()) {
            info.tasks.push_back(std::string{to_string(task.verb)} + " " + task.task);
            into.add(std::move(task));
        }
    } catch (const error& e) {
        // Tasks that were registered are answered `unavailable` from now on.
        plugin.close();
        plugin.stop();
        throw plugin_error(path, e.what());
    }
    plugins_.push_back(std::move(info));
}

plugin_figures plugin_host::figures() const {
    return {.loaded = plugins_.size(), .jobs = state_->jobs.size(), .answered_twice = state_->jobs.unknown_answers()};
}

plugin_stop_report plugin_host::stop(std::chrono::milliseconds limit) {
    if (std::exchange(stopped_, true)) {
        return {};
    }
    for (const auto& plugin : state_->plugins) {
        plugin->close();
    }
    auto callbacks =
        state_->jobs.close([&](const responder& to) { to.fail(errc::unavailable, options_.node + " has stopped"); });
    for (auto& callback : callbacks) {
        state_->notifier.notify({.callback = std::move(callback)});
    }
    std::promise<void> all_stopped;
    const auto end = all_stopped.get_future();
    const auto stop_all = [state = state_, limit] {
        // A callback that blocks must not prevent the plugins from stopping.
        state->callbacks_left = state->notifier.close(limit / 2);
        for (auto left = state->plugins.size(); left > 0; --left) {
            state->plugins[left - 1]->stop();
        }
    };
    try { // on a thread of its own, because a plugin may take long, or never return
        std::thread{[stop_all, all_stopped = std::move(all_stopped)]() mutable {
            stop_all();
            all_stopped.set_value();
        }}.detach();
    } catch (const std::system_error&) { // the system refuses the thread, but the plugins have to free their devices
        stop_all();
    }
    end.wait_for(limit);
    plugin_stop_report report{.callbacks = state_->callbacks_left};
    for (const auto& plugin : state_->plugins) {
        if (!plugin->has_stopped()) {
            report.late.push_back(plugin->name());
        }
        plugin->disable_log(); // the log may be destroyed before a plugin that does not end
    }
    return report;
}

} // namespace cles::runtime
