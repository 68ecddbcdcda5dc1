// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/run.hpp>
#include <cles/wake_bound.hpp>

#include "config/config.hpp"
#include "config/config_file.hpp"
#include "config/config_sources.hpp"
#include "daemon/command_line.hpp"
#include "daemon/daemon.hpp"
#include "daemon/daemon_log.hpp"
#include "daemon/idle_memory.hpp"
#include "daemon/service_manager.hpp"
#include "daemon/service_parts.hpp"
#include "daemon/start_trial.hpp"
#include "isolation/plugin_process_main.hpp"
#include "output/terminal.hpp"
#include "plugins/plugin_trial.hpp"

#include <boost/asio/io_context.hpp>

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <memory>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <variant>

#include <unistd.h>

namespace cles::runtime {
namespace {

// The exit codes.
constexpr int success = 0;
constexpr int cannot_run = 1;
constexpr int wrong_usage = 2;
constexpr int name_conflict = 3;

// How long it waits for readers of its output, whom it must not depend on.
constexpr std::chrono::seconds output_wait{1};

int report(const std::string& text, int code) {
    tool::write_within(tool::stream::err, "clesd: " + text + "\n", output_wait);
    return code;
}

std::string host_name() {
    std::array<char, 256> name{};
    return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

config_sources sources_of(const command_line_options& wanted) {
    return {.file = wanted.config,
            .flags = wanted.flags,
            .variable = [](const char* name) -> const char* { return std::getenv(name); },
            .host = host_name(),
            .cores = std::thread::hardware_concurrency(),
            .name_of_key = name_of_key};
}

// For a system error: what could not be done, then why, without repetition.
std::string message_of(const error& e) {
    const auto why = e.code().message();
    if (e.code().category() == error_category() || e.message().empty()) {
        return e.what();
    }
    return e.message().find(why) != std::string::npos ? e.message() : e.message() + ": " + why;
}

// Child processes must not notify it.
service_manager take_service_manager() {
    const char* socket = std::getenv("NOTIFY_SOCKET");
    service_manager made{socket == nullptr ? "" : socket,
                         watchdog_of(std::getenv("WATCHDOG_USEC"), std::getenv("WATCHDOG_PID"), ::getpid())};
    for (const auto* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) {
        ::unsetenv(name);
    }
    return made;
}

std::unique_ptr<const wake_bound> limit_wake_latency(const config& setup) {
    try {
        return setup.wake_within ? std::make_unique<const wake_bound>(*setup.wake_within) : nullptr;
    } catch (const std::system_error& e) {
        throw config_error(setup.location_of("wake_within"), e.what());
    }
}

run_options run_options_of(const config& setup) {
    return {.busy_poll = setup.busy_poll,
            .fifo_priority = static_cast<int>(setup.real_time),
            .lock_memory = setup.real_time != 0};
}

/// While it lives, `std::terminate` waits for the log before it ends the process: what was logged last may be why.
class log_before_terminate {
  public:
    explicit log_before_terminate(daemon_log& log) noexcept {
        log_ = &log;
        before_ = std::set_terminate(on_terminate);
    }
    log_before_terminate(const log_before_terminate&) = delete;
    log_before_terminate& operator=(const log_before_terminate&) = delete;
    ~log_before_terminate() { std::set_terminate(before_); }

  private:
    [[noreturn]] static void on_terminate() {
        constexpr unsigned longest_s = 2;
        std::signal(SIGALRM, SIG_DFL);
        ::alarm(longest_s); // this thread may have the lock of the log
        log_.load()->flush();
        before_.load()();
        std::abort();
    }

    static inline std::atomic<daemon_log*> log_{nullptr};
    static inline std::atomic<std::terminate_handler> before_{nullptr};
};

// Does what `run` does, but ends what it has begun. Plugins are tried, each in a process of its own, but not started: a
// running daemon may use their devices.
int check_start(config setup) {
    try_plugins(setup);
    for (const auto& plugin : setup.plugins) {
        if (!plugin.trial_error.empty()) {
            report(plugin.trial_error + " (it is not required)", success);
        }
    }
    const auto latency_limit = limit_wake_latency(setup);
    const bool runs = try_start(setup, [](log_level level, const log_entry& entry) {
        if (level >= log_level::warning) {
            report("warning: " + std::string{entry.text}, success);
        }
    });
    boost::asio::io_context idle{1};
    cles::run(idle, run_options_of(setup));
    tool::write_output((setup.file.empty() ? "without a file: " : setup.file + ": ") + "can be used" +
                       (runs ? "; the node " + setup.node + " listens already" : "") + "\n");
    return success;
}

int run(config setup, config_sources sources) {
    const auto manager = take_service_manager();
    try_plugins(setup); // while there are no threads
    const auto node = setup.node;
    const auto how = run_options_of(setup);
    daemon_log log{node, setup.log};
    const log_before_terminate last_lines{log};
    const auto latency_limit = limit_wake_latency(setup); // before the service manager is notified
    boost::asio::io_context io{1};
    daemon clesd{io, std::move(setup), std::move(sources), log, manager};
    log.flush(); // who reads that it listens may look for what it has logged before
    for (const auto& endpoint : clesd.endpoints()) {
        std::string line{node};
        line.append(" listening on ").append(endpoint).push_back('\n');
        tool::write_within(tool::stream::out, line, output_wait);
    }
    if (!manager.ready()) {
        log.warning("the service manager could not be notified");
    }
    cles::run(io, how);
    const int code = clesd.lost_name() ? name_conflict : success;
    log.close(); // while another signal does no harm
    if (clesd.has_unfinished_work()) {
        std::_Exit(code); // without waiting for it
    }
    return code;
}

// The parent's signal settings are inherited. Ignoring SIGCHLD would hide how a plugin's trial ended, and a blocked
// signal would neither stop the daemon nor end a plugin's start that hangs.
void set_up_signals() {
    sigset_t none;
    ::sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    std::signal(SIGCHLD, SIG_DFL);
    std::signal(SIGPIPE, SIG_IGN); // if a reader of its output ends
}

int start(int argc, const char* const* argv) {
    const auto parsed = parse_command_line(argc, argv);
    if (const auto* text = std::get_if<std::string>(&parsed)) {
        tool::write_output(*text);
        return success;
    }
    const auto& wanted = std::get<command_line_options>(parsed);
    auto sources = sources_of(wanted);
    auto setup = load(sources);
    if (!wanted.print_config && !wanted.check) {
        return run(std::move(setup), std::move(sources));
    }
    if (wanted.print_config) {
        tool::write_output(to_yaml(setup));
    }
    return wanted.check ? check_start(std::move(setup)) : success;
}

} // namespace
} // namespace cles::runtime

int main(int argc, char** argv) {
    using namespace cles::runtime;
    if (is_plugin_process(argc, argv)) {
        return run_plugin_process(argc, argv);
    }
    set_up_signals();
    keep_little_memory();
    try {
        return start(argc, argv);
    } catch (const tool::output_closed&) {
        return success;
    } catch (const usage_error& e) {
        return report(std::string{e.what()} + "\nclesd: run clesd --help for the options", wrong_usage);
    } catch (const config_error& e) {
        return report(e.what(), wrong_usage);
    } catch (const cles::error& failed) {
        return report(message_of(failed), cannot_run);
    } catch (const boost::system::system_error& failed) {
        return report(failed.code().message(), cannot_run); // what() may contain the path of a header
    } catch (const std::exception& failed) {
        return report(failed.what(), cannot_run);
    }
}
