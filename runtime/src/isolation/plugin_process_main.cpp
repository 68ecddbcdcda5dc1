// SPDX-License-Identifier: BSL-1.0
#include "isolation/plugin_process_main.hpp"

#include <cles/plugin_abi.h>

#include "isolation/confinement.hpp"
#include "isolation/plugin_messages.hpp"
#include "isolation/plugin_process.hpp"
#include "isolation/process_jobs.hpp"
#include "plugins/plugin_host.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <linux/close_range.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

namespace cles::runtime {
namespace {

constexpr std::chrono::milliseconds max_stop_time{2'000};
constexpr int not_for_people = 2;

template <class T>
std::optional<T> number_of(const char* text) noexcept {
    const std::string_view all{text};
    T number{};
    const auto [end, failed] = std::from_chars(all.data(), all.data() + all.size(), number);
    return failed == std::errc{} && end == all.data() + all.size() ? std::optional<T>{number} : std::nullopt;
}

/// Reads lines from a socket.
class line_reader {
  public:
    explicit line_reader(int socket) noexcept : socket_(socket) {}

    /// The next line, which is valid until the next call; nothing at the end.
    std::optional<std::string_view> next() {
        input_.erase(0, std::exchange(taken_, 0));
        for (auto searched = std::size_t{0};;) {
            const auto end = input_.find('\n', searched);
            if (end != std::string::npos) {
                taken_ = end + 1;
                return std::string_view{input_}.substr(0, end);
            }
            searched = input_.size();
            std::array<char, 8192> part; // NOLINT(*-member-init): it is written before it is read
            const auto size = ::recv(socket_, part.data(), part.size(), 0);
            if (size > 0) {
                input_.append(part.data(), static_cast<std::size_t>(size));
            } else if (size == 0 || errno != EINTR) {
                return std::nullopt;
            }
        }
    }

  private:
    int socket_;
    std::string input_;
    std::size_t taken_ = 0;
};

/// Passes the tasks of the plugin to the jobs, and its updates to the daemon.
class process_registrar final : public registrar {
  public:
    process_registrar(process_jobs& jobs, control_connection& daemon) : jobs_(jobs), daemon_(daemon) {}

    void add(registration task) override {
        const auto& info = task.info;
        offered.push_back({.verb = std::string{to_string(task.verb)},
                           .task = task.task,
                           .description = info.description,
                           .parameters = info.parameters,
                           .idempotent = info.idempotent,
                           .local = info.local,
                           .must_be_signed = info.must_be_signed,
                           .handled = task.async != nullptr});
        jobs_.add(std::move(task));
    }
    [[nodiscard]] publisher make_publisher() override { return publisher{std::make_shared<sink>(daemon_)}; }

    std::vector<offered_task> offered{};

  private:
    class sink final : public detail::update_sink {
      public:
        explicit sink(control_connection& daemon) noexcept : daemon_(daemon) {}
        void publish(std::string_view noun, std::string_view json) override {
            std::string line;
            wire_line_writer{line, verb::update, control_task}.parameter("publish").parameter(noun).body(
                std::string_view{reply_body(json)});
            daemon_.say(line);
        }

      private:
        control_connection& daemon_;
    };

    process_jobs& jobs_;
    control_connection& daemon_;
};

/// The process: its plugin, and the threads of its lanes.
class plugin_runner {
  public:
    plugin_runner(std::size_t lanes, const load_message& wanted)
        : wanted_(wanted), lanes_(lanes), host_(host_options()) {}

    // Loads the plugin. False if it cannot be used, which the daemon has been told.
    bool start() {
        process_registrar tasks{jobs_, daemon_};
        try {
            const confinement limits{.memory = wanted_.memory,
                                     .open_files = wanted_.open_files,
                                     .readable = wanted_.readable,
                                     .writable = wanted_.writable,
                                     .threads = lanes_};
            const std::vector<std::filesystem::path> folders(wanted_.folders.begin(), wanted_.folders.end());
            const auto confined = confine(limits, find_plugin(wanted_.path, folders));
            host_.load(wanted_.path, wanted_.config, tasks, wanted_.sha256);
            const auto& loaded = host_.plugins().back();
            tell("started", started_message{loaded.name, loaded.version, confined, tasks.offered});
            return true;
        } catch (const plugin_error& e) {
            // Without the path, with which the daemon begins the message again.
            std::string_view why{e.what()};
            why.remove_prefix(std::min(wanted_.path.size() + 2, why.size()));
            tell("refused", refused_message{std::string{why}, e.setting()});
        } catch (const std::exception& e) {
            tell("refused", refused_message{e.what(), std::nullopt});
        }
        return false;
    }

    // Until the daemon ends it.
    void run(line_reader& control) {
        for (std::size_t i = 0; i < lanes_; ++i) {
            std::thread{[this, socket = control_descriptor + 1 + static_cast<int>(i)] { serve(socket); }}.detach();
        }
        while (const auto line = control.next()) {
            const auto read = read_wire_line(*line);
            if (!read || read->parameters.empty()) {
                break;
            }
            const auto& what = read->parameters.front();
            if (what == "cancel") {
                jobs_.cancel(read->number_at(1));
            } else if (what == "unwanted") {
                jobs_.unwanted(read->number_at(1));
            } else if (what == "answered") {
                jobs_.resume_elsewhere(*read);
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
        options.folders = options.rules.folders;
        options.trial = std::chrono::milliseconds{0}; // this process is the trial
        options.log = [this](log_level level, std::string_view plugin, std::string_view text) {
            if (const auto job = process_jobs::traced_here(); job != 0) { // the daemon adds its trace
                std::string line;
                wire_line_writer{line, verb::push, control_task}.parameter("log").parameter(job).body(
                    log_message{static_cast<std::uint32_t>(level), std::string{plugin} + ": " + std::string{text}});
                daemon_.say(line);
                return;
            }
            tell("log", log_message{static_cast<std::uint32_t>(level), std::string{text}});
        };
        return options;
    }

    template <class T>
    void tell(std::string_view what, const T& body) {
        std::string line;
        wire_line_writer{line, verb::push, control_task}.parameter(what).body(body);
        daemon_.say(line);
    }

    // One request after another.
    void serve(int socket) {
        line_reader lane{socket};
        while (const auto line = lane.next()) {
            const auto read = read_wire_line(*line);
            if (!read) {
                ::_exit(not_for_people);
            }
            std::string reply;
            if (read->task == control_task) {
                try {
                    jobs_.resume(*read);
                } catch (const std::exception& e) {
                    tell("log", log_message{CLES_LOG_ERROR, std::string{"a callback threw: "} + e.what()});
                } catch (...) {
                    tell("log", log_message{CLES_LOG_ERROR, "a callback threw"});
                }
                reply = "id=1 {}\n";
            } else {
                reply = jobs_.serve(*read, wanted_.node);
            }
            for (std::string_view rest = reply; !rest.empty();) {
                const auto sent = ::send(socket, rest.data(), rest.size(), MSG_NOSIGNAL);
                if (sent < 0 && errno != EINTR) {
                    return; // the daemon has ended
                }
                rest.remove_prefix(static_cast<std::size_t>(std::max<ssize_t>(sent, 0)));
            }
        }
    }

    const load_message& wanted_;
    std::size_t lanes_;
    control_connection daemon_{control_descriptor};
    process_jobs jobs_{daemon_};
    plugin_host host_;
};

} // namespace

bool is_plugin_process(int argc, const char* const* argv) noexcept {
    return argc == 4 && std::string_view{argv[1]} == plugin_process_mode;
}

int run_plugin_process(int argc, const char* const* argv) {
    const auto parent = is_plugin_process(argc, argv) ? number_of<pid_t>(argv[2]) : std::nullopt;
    const auto lanes = parent ? number_of<std::size_t>(argv[3]) : std::nullopt;
    if (!lanes) {
        std::fputs("clesd: the daemon itself starts this\n", stderr);
        return not_for_people;
    }
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != *parent) {
        ::_exit(0); // it has ended already
    }
    const auto own = static_cast<unsigned>(control_descriptor);
    const auto others = own + 1 + static_cast<unsigned>(*lanes);
    ::close_range(others, ~0U, 0);
    ::close_range(own, others - 1, CLOSE_RANGE_CLOEXEC);
    std::signal(SIGPIPE, SIG_IGN);
    line_reader control{control_descriptor};
    const auto first = control.next();
    const auto line = first ? read_wire_line(*first) : std::nullopt;
    load_message wanted;
    if (!line || !from_json(line->body, wanted)) {
        std::fputs("clesd: the daemon itself starts this\n", stderr);
        return not_for_people;
    }
    auto& runner = *new plugin_runner{*lanes, wanted}; // never destroyed: threads may use it
    if (runner.start()) {
        runner.run(control);
    }
    ::_exit(0); // without the exit handlers of the plugin, whose threads may still run
}

} // namespace cles::runtime
