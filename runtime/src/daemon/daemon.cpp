// SPDX-License-Identifier: BSL-1.0
#include "daemon/daemon.hpp"

#include "config/config.hpp"
#include "config/config_file.hpp"
#include "config/config_values.hpp"
#include "daemon/service_setup.hpp"
#include "jobs/current_trace.hpp"
#include "jobs/pooled_registrar.hpp"
#include "plugins/plugin_library.hpp"
#include "plugins/plugin_start_guard.hpp"
#include "plugins/plugin_trial.hpp"

#include <boost/asio/post.hpp>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <optional>
#include <utility>

namespace cles::runtime {
namespace {

using namespace std::chrono_literals;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr int exit_configuration_error = 2;
constexpr std::chrono::seconds start_limit{10};

pool_options pool_options_of(const config& setup, daemon_log& log) {
    pool_options options;
    options.workers = setup.workers;
    options.queue = setup.queue;
    options.replacements = setup.replacements;
    options.grace = std::chrono::ceil<milliseconds>(setup.stuck_after);
    options.max_wait = 100ms;
    options.check_interval = 250ms;
    options.log = log.sink();
    return options;
}

plugin_host_options host_options_of(const config& setup, daemon_log& log) {
    plugin_host_options options{.node = setup.node};
    options.rules = plugin_rules_of(setup);
    options.trial = 0ms; // they were tried before threads were started
    options.log = [&log](log_level level, std::string_view plugin, std::string_view text) {
        const auto line = std::string{plugin} + ": " + std::string{text};
        log.write(level, {line, {}, 0, current_trace::id()});
    };
    return options;
}

load_message load_message_of(const config& setup, const plugin_config& wanted, const std::string& path) {
    const auto rules = plugin_rules_of(setup);
    load_message made{.node = setup.node,
                      .path = path,
                      .config = wanted.config,
                      .sha256 = wanted.sha256,
                      .folders = {},
                      .secured = rules.secured,
                      .limits = wanted.limits};
    for (const auto& folder : rules.folders) {
        made.folders.push_back(folder.string());
    }
    return made;
}

std::string counted(std::size_t count, const char* what) {
    return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

// The settings that a reload does not change, as text to compare.
std::string fixed_part(config setup) {
    setup.seeds.clear();
    setup.log = {};
    setup.origins.clear();
    return to_yaml(setup);
}

} // namespace

daemon::daemon(boost::asio::io_context& io, config setup, config_sources sources, daemon_log& log,
               const service_manager& manager)
    : io_(io), setup_(std::move(setup)), sources_(std::move(sources)), log_(log), service_manager_(manager),
      service_(io,
               [this] {
                   auto options = options_of(setup_, log_.sink());
                   options.load = [this] { return has_pool_ ? pool_.load() : node_load{}; };
                   if (!setup_.allow_clash) {
                       options.on_name_taken = [this](std::string_view where) { on_name_conflict(where); };
                   }
                   options.metrics = [this](json_writer& w) { write_metrics(w); };
                   return options;
               }()),
      pool_(service_, pool_options_of(setup_, log)), plugins_(host_options_of(setup_, log)),
      signals_(io, SIGTERM, SIGINT, SIGHUP), heartbeat_(io), memory_timer_(io) {
    wait_for_signal();
    has_pool_ = true;
    if (setup_.sharing) {
        pool_.share(service_);
    }
    try {
        load_plugins();
    } catch (...) {
        end_isolated(0ms);
        service_.stop(); // while everything that it uses exists
        throw;
    }
    if (service_manager_.heartbeat().count() != 0) {
        wait_for_heartbeat();
    }
    if (setup_.real_time == 0) { // else all memory is locked, and page faults are to be avoided
        idle_memory_.emplace(usage_of_process());
        wait_for_idle_memory();
    }
}

daemon::~daemon() {
    end_isolated(0ms);
    service_.stop();
}

void daemon::load_plugins() {
    for (std::size_t i = 0; i < setup_.plugins.size(); ++i) {
        const auto& wanted = setup_.plugins[i];
        if (!wanted.trial_error.empty()) {
            log_.warning(wanted.trial_error + " (continuing without it)");
            continue;
        }
        try {
            load_plugin(i);
        } catch (const plugin_error& e) {
            const auto message = plugin_error_message(setup_, i, e);
            if (wanted.required) {
                throw config_error(message);
            }
            log_.warning(message + " (continuing without it)");
        }
    }
}

void daemon::load_plugin(std::size_t index) {
    const auto& wanted = setup_.plugins[index];
    const auto path = resolve_plugin_path(setup_, wanted);
    if (wanted.isolated) {
        load_isolated(index, path);
        return;
    }
    log_.flush(); // the guard may end the process
    {
        const plugin_start_guard guard{"clesd: " + setup_.location_of("plugins[" + std::to_string(index) + "].path") +
                                           ": " + path,
                                       exit_configuration_error, start_limit};
        pooled_registrar tasks{service_, pool_};
        plugins_.load(path, wanted.config, tasks, wanted.sha256);
    }
    const auto& loaded = plugins_.plugins().back();
    log_.info("plugin " + loaded.name + " " + loaded.version + " with " + counted(loaded.tasks.size(), "task") +
              " from " + loaded.path);
}

void daemon::load_isolated(std::size_t index, const std::string& path) {
    const auto isolated = std::make_shared<isolated_plugin>(
        service_, pool_, host_options_of(setup_, log_).log, load_message_of(setup_, setup_.plugins[index], path),
        session_options{.plugin = std::filesystem::path{path}.filename().string(),
                        .lanes = setup_.lanes(),
                        .grace = setup_.stuck_after,
                        .max_line = 2 * setup_.limits.line + 65536});
    isolated->start();
    isolated_.push_back({index, isolated});
}

// On the context, so that a daemon whose context is stuck is started again. What cannot be sent now is sent with the
// next one.
void daemon::wait_for_heartbeat() {
    heartbeat_.expires_after(service_manager_.heartbeat());
    heartbeat_.async_wait([this](boost::system::error_code code) {
        if (!code) {
            static_cast<void>(service_manager_.alive());
            wait_for_heartbeat();
        }
    });
}

void daemon::wait_for_idle_memory() {
    memory_timer_.expires_after(idle_memory::interval);
    memory_timer_.async_wait([this](boost::system::error_code code) {
        if (code) {
            return;
        }
        if (idle_memory_->is_time(usage_of_process())) {
            return_unused_memory();
            idle_memory_->returned(usage_of_process());
        }
        wait_for_idle_memory();
    });
}

void daemon::write_metrics(json_writer& w) const {
    w.key("pool");
    write_json(w, pool_.figures());
    w.key("plugins");
    write_json(w, plugins_.figures());
    if (!isolated_.empty()) {
        w.key("isolated");
        w.begin_array();
        for (const auto& each : isolated_) {
            write_json(w, each.plugin->figures());
        }
        w.end_array();
    }
}

// -- the end -------------------------------------------------------------------------------------------------------

void daemon::wait_for_signal() {
    signals_.async_wait([this](boost::system::error_code code, int signal) {
        if (code) {
            return;
        }
        wait_for_signal(); // first, because stopping and reloading may cancel it
        if (signal == SIGHUP) {
            reload();
        } else {
            stop(signal);
        }
    });
}

void daemon::stop(int signal) {
    const std::string name = signal == SIGINT ? "SIGINT" : "SIGTERM";
    if (std::exchange(signalled_, true)) {
        log_.warning("stopping immediately on a second signal");
        stopped_at_once_ = true;
        finish();
        return;
    }
    if (std::exchange(stopping_, true)) {
        log_.info(name + ": already stopping; a second signal stops immediately");
        return;
    }
    stop_begun_ = steady_clock::now();
    const auto load = pool_.load();
    log_.info("stopping on " + name + "; " + counted(load.running, "job") + " running, " + std::to_string(load.queued) +
              " waiting");
    drain();
}

void daemon::on_name_conflict(std::string_view where) {
    if (std::exchange(stopping_, true)) {
        return;
    }
    lost_name_ = true;
    stop_begun_ = steady_clock::now();
    log_.error("stopping: the node at " + std::string{where} + " had the name '" + setup_.node +
               "' first; choose another name (--node), or allow it (--allow-clash)");
    drain();
}

void daemon::drain() {
    if (!service_manager_.stopping()) {
        log_.warning("the service manager could not be notified");
    }
    service_.leave(); // so that other nodes send no jobs that would be refused
    pool_.drain(std::chrono::ceil<milliseconds>(setup_.drain), [this](const drain_report& report) { close(report); });
}

milliseconds daemon::time_left() const {
    return std::chrono::floor<milliseconds>(stop_begun_ + setup_.drain - steady_clock::now());
}

void daemon::close(const drain_report& report) {
    if (report.abandoned > 0) {
        log_.warning(counted(report.abandoned, "job") + " did not end in time");
    }
    // Forwarded requests, and those that plugins serve without workers, have to be answered too.
    service_.async_close(std::max<milliseconds>(time_left(), 100ms), [this](boost::system::error_code) { finish(); });
}

void daemon::finish() {
    if (std::exchange(finished_, true)) {
        return;
    }
    // Plugins may use the remaining time to stop, and at least `min_stop_time`: only a plugin that blocks takes so
    // long.
    const auto limit =
        stopped_at_once_ ? 100ms : std::clamp<milliseconds>(time_left(), plugin_host::min_stop_time, 2000ms);
    for (const auto& each : isolated_) {
        each.plugin->begin_stop(); // they stop at the same time as the others
    }
    const auto until = steady_clock::now() + limit;
    const auto stopped = plugins_.stop(limit);
    end_isolated(std::chrono::ceil<milliseconds>(until - steady_clock::now()));
    for (const auto& name : stopped.late) {
        log_.warning("plugin " + name + " did not stop in time");
    }
    if (stopped.callbacks > 0) {
        log_.warning(counted(stopped.callbacks, "on_stop callback") + " of plugins did not return");
    }
    unfinished_work_ = !stopped.late.empty() || stopped.callbacks > 0;
    service_.stop();
    if (!stopped_at_once_) {
        // Here, and not in the destructor, to find out whether work is unfinished. Jobs that were told to stop at the
        // end of the drain get a moment to do so.
        unfinished_work_ = pool_.close(std::clamp<milliseconds>(time_left(), 100ms, 2000ms)) > 0 || unfinished_work_;
    }
    signals_.cancel();
    heartbeat_.cancel();
    memory_timer_.cancel();
    log_.info("stopped");
    // A job that does not end is still watched, and keeps the context running.
    boost::asio::post(io_, [this] { io_.stop(); });
}

void daemon::end_isolated(milliseconds limit) {
    for (const auto& each : isolated_) {
        each.plugin->begin_stop();
    }
    const auto until = steady_clock::now() + limit;
    for (const auto& [index, plugin] : isolated_) {
        if (plugin->finish_stop(until)) {
            log_.warning("plugin " + plugin->figures().name + " did not stop in time, and its process was ended");
        }
    }
    isolated_.clear();
}

// -- reload --------------------------------------------------------------------------------------------------------

void daemon::reload() {
    bool notified = service_manager_.reloading(steady_clock::now());
    try {
        auto fresh = load(sources_);
        log_.set(fresh.log);
        log_.info("reloaded the configuration: " + counted(fresh.seeds.size(), "seed") + ", log " +
                  std::string{to_string(fresh.log.level)});
        retry_isolated(&fresh);
        if (fixed_part(fresh) != fixed_part(setup_)) {
            log_.warning("other changes of the configuration take effect at the next start");
        }
        service_.set_gossip(cles::gossip(fresh.seeds, setup_.links));
        setup_.seeds = fresh.seeds;
        setup_.log = fresh.log;
    } catch (const config_error& e) {
        log_.error(std::string{"kept the old configuration, because the new one cannot be used: "} + e.what());
        retry_isolated(nullptr);
    }
    notified = service_manager_.ready() && notified;
    if (!notified) {
        log_.warning("the service manager could not be notified");
    }
}

// With the settings and limits of the new configuration, if there is one and it still has the plugin.
void daemon::retry_isolated(const config* fresh) {
    for (const auto& [index, plugin] : isolated_) {
        auto& known = setup_.plugins[index];
        std::optional<load_message> changed;
        const plugin_config* wanted = nullptr;
        if (fresh != nullptr) {
            const auto found = std::ranges::find(fresh->plugins, known.path, &plugin_config::path);
            if (found == fresh->plugins.end() || !found->isolated) {
                continue; // no longer wanted
            }
            wanted = &*found;
            changed = load_message_of(setup_, *wanted, resolve_plugin_path(setup_, known));
        }
        if (plugin->retry(std::move(changed)) && wanted != nullptr) {
            known = *wanted;
        }
    }
}

} // namespace cles::runtime
