// SPDX-License-Identifier: BSL-1.0
#include "isolation/plugin_process_main.hpp"

#include "isolation/confinement.hpp"
#include "isolation/descriptor.hpp"
#include "isolation/line_buffer.hpp"
#include "isolation/plugin_messages.hpp"
#include "isolation/plugin_process.hpp"
#include "isolation/process_jobs.hpp"
#include "isolation/wire_line.hpp"
#include "plugins/plugin_host.hpp"

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

namespace cles::runtime {
namespace {

constexpr std::chrono::milliseconds max_stop_time{2'000};
constexpr int exit_wrong_usage = 2;

/// Reads lines from a socket.
class line_reader {
  public:
    explicit line_reader(int socket) noexcept : socket_(socket) {}

    /// The next line, which is valid until the next call; nothing at the end.
    std::optional<std::string_view> next() {
        for (;;) {
            if (const auto line = input_.next()) {
                return line;
            }
            std::array<char, 8192> part; // NOLINT(*-member-init): it is written before it is read
            const auto size = ::recv(socket_, part.data(), part.size(), 0);
            if (size > 0) {
                input_.append({part.data(), static_cast<std::size_t>(size)});
            } else if (size == 0 || errno != EINTR) {
                return std::nullopt;
            }
        }
    }

  private:
    int socket_;
    line_buffer input_;
};

/// Passes updates to the daemon, which takes those of the plugin's own tasks only: so not before it knows these.
class update_connection final : public detail::update_sink {
  public:
    explicit update_connection(control_connection& daemon) noexcept : daemon_(daemon) {}

    void publish(std::string_view noun, std::string_view json) override {
        const auto line =
            wire_line_writer{verb::update, control_task}.parameter("publish").parameter(noun).body(reply_body(json));
        const std::scoped_lock lock{mutex_};
        if (open_) {
            daemon_.say(line);
        } else {
            early_.append(line);
        }
    }
    void open() {
        const std::scoped_lock lock{mutex_};
        open_ = true;
        daemon_.say(std::exchange(early_, {}));
    }

  private:
    control_connection& daemon_;
    std::mutex mutex_;
    std::string early_;
    bool open_ = false;
};

/// Passes the tasks of the plugin to the jobs, and its updates to the daemon.
class process_registrar final : public registrar {
  public:
    process_registrar(process_jobs& jobs, std::shared_ptr<detail::update_sink> updates)
        : jobs_(jobs), updates_(std::move(updates)) {}

    void add(registration task) override {
        offered.push_back({.verb = std::string{to_string(task.verb)},
                           .task = task.task,
                           .info = task.info,
                           .handled = task.async != nullptr});
        jobs_.add(std::move(task));
    }
    [[nodiscard]] publisher make_publisher() override { return publisher{updates_}; }

    std::vector<offered_task> offered{};

  private:
    process_jobs& jobs_;
    std::shared_ptr<detail::update_sink> updates_;
};

/// The process: its plugin, and the threads of its lanes.
class plugin_runner {
  public:
    plugin_runner(std::size_t lanes, const load_message& wanted)
        : wanted_(wanted), lanes_(lanes), host_(host_options()) {}

    // Loads the plugin. False if it cannot be used, which the daemon has been told.
    bool start() {
        process_registrar tasks{jobs_, updates_};
        try {
            const std::vector<std::filesystem::path> folders(wanted_.folders.begin(), wanted_.folders.end());
            auto confined = confine(wanted_.limits, lanes_, find_plugin(wanted_.path, folders), wanted_.require_paths);
            host_.load(wanted_.path, wanted_.config, tasks, wanted_.sha256);
            start_lanes();
            const auto& loaded = host_.plugins().back();
            tell("started", started_message{.name = loaded.name,
                                            .version = loaded.version,
                                            .confinement = std::move(confined.in_force),
                                            .missing = std::move(confined.missing),
                                            .tasks = tasks.offered});
            updates_->open();
            return true;
        } catch (const plugin_error& e) {
            tell("refused", refused_message{std::string{e.why()}, e.key()});
        } catch (const std::exception& e) {
            tell("refused", refused_message{e.what(), "path"});
        }
        return false;
    }

    // Until the daemon ends it.
    void run(line_reader& control) {
        while (const auto line = control.next()) {
            const auto read = read_wire_line(*line);
            if (!read || read->parameters.empty()) {
                break;
            }
            const auto& what = read->parameters.front();
            if (what == "cancel") {
                jobs_.cancel(read->number_at(1));
            } else if (what == "progress_unwanted") {
                jobs_.progress_unwanted(read->number_at(1));
            } else if (what == "answered") {
                jobs_.resume_on_notifier(*line);
            } else if (what == "leaving") {
                break;
            }
        }
        host_.stop(max_stop_time);
    }

  private:
    [[nodiscard]] plugin_host_options host_options() {
        plugin_host_options options{.node = wanted_.node};
        options.rules = {.secured = wanted_.secured, .folders = {wanted_.folders.begin(), wanted_.folders.end()}};
        options.trial = std::chrono::milliseconds{0}; // this process is the trial
        options.log = [this](log_level level, std::string_view plugin, std::string_view text) {
            // The daemon adds the trace of a job, but not the plugin's name.
            const auto job = process_jobs::traced_here();
            daemon_.log(level, job == 0 ? std::string{text} : std::string{plugin} + ": " + std::string{text}, job);
        };
        return options;
    }

    void start_lanes() {
        try {
            for (std::size_t i = 0; i < lanes_; ++i) {
                std::thread{[this, socket = control_descriptor + 1 + static_cast<int>(i)] { serve(socket); }}.detach();
            }
        } catch (const std::system_error& e) {
            throw plugin_error(wanted_.path, "cannot start its " + std::to_string(lanes_) + " threads: " + e.what());
        }
    }

    template <class T>
    void tell(std::string_view what, const T& body) {
        daemon_.say(wire_line_writer{verb::push, control_task}.parameter(what).body(body));
    }

    // One request after another.
    void serve(int socket) {
        line_reader lane{socket};
        while (const auto line = lane.next()) {
            const auto read = read_wire_line(*line);
            if (!read) {
                ::_exit(exit_wrong_usage);
            }
            std::string reply;
            if (read->task == control_task) {
                jobs_.resume(*read, *line);
                reply = "id=1 {}\n";
            } else {
                reply = jobs_.serve(*read, wanted_.node);
            }
            if (send_all(socket, reply) != 0) {
                return; // the daemon has ended
            }
        }
    }

    const load_message& wanted_;
    std::size_t lanes_;
    control_connection daemon_{control_descriptor};
    std::shared_ptr<update_connection> updates_ = std::make_shared<update_connection>(daemon_);
    process_jobs jobs_{daemon_};
    plugin_host host_;
};

int reject_usage() {
    std::fputs("clesd: --plugin-process is for internal use; run clesd without it\n", stderr);
    return exit_wrong_usage;
}

} // namespace

bool is_plugin_process(int argc, const char* const* argv) noexcept {
    return argc > 1 && std::string_view{argv[1]} == plugin_process_mode;
}

int run_plugin_process(int argc, const char* const* argv) {
    // A service manager may send these to all processes of the daemon, which ends this one in order.
    for (const int number : {SIGTERM, SIGINT, SIGHUP, SIGPIPE}) {
        std::signal(number, SIG_IGN);
    }
    sigset_t none;
    ::sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    const auto parent = argc == 5 ? to_number<pid_t>(argv[2]) : std::nullopt;
    const auto lanes = parent ? to_number<std::uint16_t>(argv[3]) : std::nullopt;
    if (!lanes) {
        return reject_usage();
    }
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != *parent) {
        return reject_usage(); // or it has ended already
    }
    const int others = control_descriptor + 1 + *lanes;
    ::closefrom(others);
    for (int fd = control_descriptor; fd < others; ++fd) {
        ::fcntl(fd, F_SETFD, FD_CLOEXEC);
    }
    line_reader control{control_descriptor};
    const auto first = control.next();
    const auto line = first ? read_wire_line(*first) : std::nullopt;
    load_message wanted;
    if (!line || !from_json(line->body, wanted)) {
        return reject_usage();
    }
    auto& runner = *new plugin_runner{*lanes, wanted}; // never destroyed: threads may use it
    if (runner.start()) {
        runner.run(control);
    }
    ::_exit(0); // without the exit handlers of the plugin, whose threads may still run
}

} // namespace cles::runtime
