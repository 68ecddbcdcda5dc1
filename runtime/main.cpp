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
#include "daemon/service_manager.hpp"
#include "plugins/plugin_trial.hpp"

#include <boost/asio/io_context.hpp>

#include <array>
#include <csignal>
#include <cstdio>
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
constexpr int name_taken = 3;

void print(std::FILE* to, const std::string& text) {
    std::fwrite(text.data(), 1, text.size(), to);
    std::fflush(to);
}

int complain(const std::string& text, int code) {
    print(stderr, "clesd: " + text + "\n");
    return code;
}

std::string host_name() {
    std::array<char, 256> name{};
    return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

config_sources sources_of(const options& wanted) {
    return {.file = wanted.config,
            .flags = wanted.flags,
            .variable = [](const char* name) -> const char* { return std::getenv(name); },
            .host = host_name(),
            .cores = std::thread::hardware_concurrency()};
}

// Plugins are tried, each in a process of its own, and not started: a daemon that runs may have their devices.
int check_plugins(config setup) {
    try_plugins(setup);
    for (const auto& plugin : setup.plugins) {
        if (!plugin.unusable.empty()) {
            complain(plugin.unusable + " (it is not required)", success);
        }
    }
    print(stdout, (setup.file.empty() ? "without a file: " : setup.file + ": ") + "can be used\n");
    return success;
}

// Of a system error first what could not be done, then why; not the other way round, and not twice.
std::string words_of(const error& e) {
    const auto why = e.code().message();
    if (e.code().category() == error_category() || e.message().empty()) {
        return e.what();
    }
    return e.message().find(why) != std::string::npos ? e.message() : e.message() + ": " + why;
}

// Children are not to tell the service manager anything.
std::string take_notify_socket() {
    const char* socket = std::getenv("NOTIFY_SOCKET");
    std::string taken = socket == nullptr ? "" : socket;
    ::unsetenv("NOTIFY_SOCKET");
    return taken;
}

std::unique_ptr<const wake_bound> bound_waking(const config& setup) {
    try {
        return setup.wake_within ? std::make_unique<const wake_bound>(*setup.wake_within) : nullptr;
    } catch (const std::system_error& refused) {
        throw config_error(setup.place_of("wake_within"), refused.what());
    }
}

int run(config setup, config_sources sources) {
    auto notify_socket = take_notify_socket();
    try_plugins(setup); // while there are no threads
    const auto node = setup.node;
    const run_options how{.busy_poll = setup.busy_poll,
                          .fifo_priority = static_cast<int>(setup.real_time),
                          .lock_memory = setup.real_time != 0};
    daemon_log log{node, setup.log};
    const auto awake = bound_waking(setup); // before anybody is told that it runs
    const notifier tell{std::move(notify_socket)};
    boost::asio::io_context io{1};
    daemon running{io, std::move(setup), std::move(sources), log, tell};
    for (const auto& endpoint : running.endpoints()) {
        std::string line{node};
        line.append(" listening on ").append(endpoint).push_back('\n');
        print(stdout, line);
    }
    if (!tell.ready()) {
        log.warning("the service manager could not be told");
    }
    cles::run(io, how);
    const int code = running.gave_way() ? name_taken : success;
    if (running.leaves_something()) {
        std::_Exit(code); // it cannot be waited for
    }
    return code;
}

// What the parent blocks or ignores is inherited. Ignoring SIGCHLD would hide how a plugin's trial ended, and a blocked
// signal would neither stop the daemon nor end a plugin's start that hangs.
void set_up_signals() {
    sigset_t none;
    ::sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    std::signal(SIGCHLD, SIG_DFL);
    std::signal(SIGPIPE, SIG_IGN); // a reader of its output that goes away
}

int start(int argc, const char* const* argv) {
    const auto asked = parse_options(argc, argv);
    if (const auto* text = std::get_if<std::string>(&asked)) {
        print(stdout, *text);
        return success;
    }
    const auto& wanted = std::get<options>(asked);
    auto sources = sources_of(wanted);
    auto setup = load(sources);
    if (wanted.print_config) {
        print(stdout, to_yaml(setup));
    }
    if (wanted.check) {
        return check_plugins(setup);
    }
    return wanted.print_config ? success : run(std::move(setup), std::move(sources));
}

} // namespace
} // namespace cles::runtime

int main(int argc, char** argv) {
    using namespace cles::runtime;
    set_up_signals();
    try {
        return start(argc, argv);
    } catch (const usage_error& wrong) {
        return complain(std::string{wrong.what()} + "\nclesd: clesd --help says what there is", wrong_usage);
    } catch (const config_error& wrong) {
        return complain(wrong.what(), wrong_usage);
    } catch (const cles::error& failed) {
        return complain(words_of(failed), cannot_run);
    } catch (const boost::system::system_error& failed) {
        return complain(failed.code().message(), cannot_run); // what() may hold the path of a header
    } catch (const std::exception& failed) {
        return complain(failed.what(), cannot_run);
    }
}
