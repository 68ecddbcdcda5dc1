// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "config/config.hpp"
#include "config/config_sources.hpp"
#include "daemon/daemon_log.hpp"
#include "daemon/service_manager.hpp"
#include "jobs/job_pool.hpp"
#include "plugins/plugin_host.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

namespace cles::runtime {

/// A node that runs plugins on its workers until it is told to stop: what `clesd` is, put together.
///
/// Used on the thread that runs the context. It ends by itself: after SIGTERM or SIGINT it admits no more jobs, lets
/// those that run end within `config::drain`, and stops the context; a second signal cuts that short. Where another
/// live node had its name first it does the same, unless `config::allow_clash` says otherwise.
class daemon {
  public:
    /// Loads the plugins and listens. \param log, tell have to outlive it
    /// \throws config_error naming the plugin that is required and cannot be used; cles::error as `service` does
    daemon(boost::asio::io_context& io, config setup, config_sources sources, daemon_log& log, const notifier& tell);
    daemon(const daemon&) = delete;
    daemon& operator=(const daemon&) = delete;
    ~daemon();

    [[nodiscard]] std::vector<std::string> endpoints() const { return service_.endpoints(); }
    /// Whether it has ended because another live node had its name first.
    [[nodiscard]] bool gave_way() const noexcept { return gave_way_; }
    /// Whether something is left that does not end, a job, an `on_stop` callback or a plugin: the process then has to
    /// go without waiting for it, by `std::_Exit`.
    [[nodiscard]] bool leaves_something() const noexcept { return cut_short_ || leaves_something_; }

  private:
    void load_plugins();
    void write_metrics(json_writer& w) const;
    void wait_for_signal();
    void stop(int signal);
    void give_way(std::string_view where);
    void drain();
    void close(const drain_report& how);
    void finish();
    void close_pool();
    [[nodiscard]] std::chrono::milliseconds time_left() const;
    void reload();

    boost::asio::io_context& io_;
    config setup_;
    const config_sources sources_;
    daemon_log& log_;
    const notifier& tell_;
    bool has_pool_ = false; // the service asks for its load
    service service_;
    job_pool pool_;
    plugin_host plugins_;
    boost::asio::signal_set signals_;
    std::chrono::steady_clock::time_point stop_begun_;
    bool stopping_ = false;
    bool signalled_ = false;
    bool cut_short_ = false; // by a second signal: it is not known what is left
    bool finished_ = false;
    bool leaves_something_ = false;
    bool gave_way_ = false;
};

} // namespace cles::runtime
