// SPDX-License-Identifier: BSL-1.0
#include "job_daemon.hpp"

#include "daemon/daemon.hpp"

#include <boost/asio/io_context.hpp>

#include <sched.h>

namespace cles::perf {

void run_daemon(const runtime::plugin_config& plugin, unsigned workers, const std::vector<int>& cores,
                const run_options& how, const child_process::announce& announce) {
    cpu_set_t allowed;
    CPU_ZERO(&allowed);
    for (const auto core : cores) {
        CPU_SET(static_cast<unsigned>(core), &allowed);
    }
    ::sched_setaffinity(0, sizeof allowed, &allowed);
    auto setup = runtime::default_config("car1", 1);
    setup.listen = {"tcp://127.0.0.1:0"};
    setup.multicast = {};
    setup.workers = workers;
    setup.plugins = {plugin};
    setup.log.level = log_level::warning;
    runtime::daemon_log log{setup.node, setup.log};
    const runtime::service_manager nobody{""};
    boost::asio::io_context io{1};
    runtime::daemon car{io, setup, {}, log, nobody};
    announce(car.endpoints().front());
    cles::run(io, how);
}

} // namespace cles::perf
