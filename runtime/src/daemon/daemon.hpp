// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "config/config.hpp"
#include "config/config_sources.hpp"
#include "daemon/daemon_log.hpp"
#include "daemon/idle_memory.hpp"
#include "daemon/service_manager.hpp"
#include "isolation/isolated_plugin.hpp"
#include "jobs/job_pool.hpp"
#include "plugins/plugin_host.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>

#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::runtime {

/// `clesd`: a node that runs plugins on its workers until it is stopped by a signal or a name conflict.
///
/// To be used on the thread that runs the context. After SIGTERM or SIGINT it admits no more jobs, lets the running
/// ones end within `config::drain`, and stops the context; a second signal stops it at once. It also stops if another
/// live node had its name first, unless `config::allow_clash` is set. While the context runs, the service manager is
/// told so.
class daemon {
  public:
    /// Loads the plugins and listens. \param log, manager have to outlive this
    /// \throws config_error if a required plugin cannot be used; cles::error as `service` does
    daemon(boost::asio::io_context& io, config setup, config_sources sources, daemon_log& log,
           const service_manager& manager);
    daemon(const daemon&) = delete;
    daemon& operator=(const daemon&) = delete;
    ~daemon();

    [[nodiscard]] std::vector<std::string> endpoints() const { return service_.endpoints(); }
    /// Whether it stopped because another live node had its name first.
    [[nodiscard]] bool lost_name() const noexcept { return lost_name_; }
    /// Whether a job, an `on_stop` callback or a plugin has not ended: the process then has to end with `std::_Exit`,
    /// without waiting for it.
    [[nodiscard]] bool has_unfinished_work() const noexcept { return stopped_at_once_ || unfinished_work_; }

  private:
    void load_plugins();
    void load_plugin(std::size_t index);
    void load_isolated(std::size_t index, const std::string& path);
    void retry_isolated(const config* fresh);
    void write_metrics(json_writer& w) const;
    void wait_for_signal();
    void wait_for_heartbeat();
    void wait_for_idle_memory();
    void stop(int signal);
    void on_name_conflict(std::string_view where);
    void drain();
    void close(const drain_report& report);
    void finish();
    void end_isolated(std::chrono::milliseconds limit);
    [[nodiscard]] std::chrono::milliseconds time_left() const;
    void reload();

    boost::asio::io_context& io_;
    config setup_;
    const config_sources sources_;
    daemon_log& log_;
    const service_manager& service_manager_;
    bool has_pool_ = false; // whether the service may read its load
    service service_;
    job_pool pool_;
    plugin_host plugins_;
    struct isolated_entry {
        std::size_t index; // of its configuration
        std::shared_ptr<isolated_plugin> plugin;
    };
    std::vector<isolated_entry> isolated_;
    boost::asio::signal_set signals_;
    boost::asio::steady_timer heartbeat_;
    boost::asio::steady_timer memory_timer_;
    std::optional<idle_memory> idle_memory_; // nothing: its memory stays
    std::chrono::steady_clock::time_point stop_begun_;
    bool stopping_ = false;
    bool signalled_ = false;
    bool stopped_at_once_ = false; // by a second signal: unfinished work is unknown
    bool finished_ = false;
    bool unfinished_work_ = false;
    bool lost_name_ = false;
};

} // namespace cles::runtime
