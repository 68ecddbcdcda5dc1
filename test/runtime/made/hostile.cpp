// SPDX-License-Identifier: BSL-1.0
// A plugin to be run in a process of its own, which some of its tasks end or try to leave. The others do what plugins
// do, to be compared with the same plugin in the daemon.
#include <cles/job_feed.hpp>
#include <cles/plugin.hpp>

#include <boost/describe/class.hpp>
#include <boost/system/error_code.hpp>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/ipc.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/xattr.h>
#include <unistd.h>

namespace {

using namespace std::chrono_literals;

struct settings {
    std::optional<bool> crash_at_start;
    std::optional<std::string> crash_while; ///< this file exists
    /// While this file exists, a start takes until the daemon says something, which is then that the plugin has to
    /// stop.
    std::optional<std::string> slow_while;
    std::optional<bool> talk_at_stop; ///< more than a pipe holds
    std::optional<std::string> padding;
};
BOOST_DESCRIBE_STRUCT(settings, (), (crash_at_start, crash_while, slow_while, talk_at_stop, padding))

struct caller {
    std::string node, transport, name, requester, forwarded_by;
    bool has_address = false, local = false;
    std::vector<std::string> parameters;
    std::string body;
    bool has_deadline = false;
    std::string trace;
};
BOOST_DESCRIBE_STRUCT(caller, (),
                      (node, transport, name, requester, forwarded_by, has_address, local, parameters, body,
                       has_deadline, trace))

struct point {
    double x = 0, y = 0;
};
BOOST_DESCRIBE_STRUCT(point, (), (x, y))

caller describe(const cles::request& asked) {
    const auto left = asked.deadline() - cles::time_point::clock::now();
    return {.node = std::string{asked.node()},
            .transport = asked.peer().transport,
            .name = asked.peer().name,
            .requester = std::string{asked.requester()},
            .forwarded_by = std::string{asked.forwarded_by()},
            .has_address = asked.peer().address.starts_with("tcp://127.0.0.1:"),
            .local = asked.peer().local,
            .parameters = {asked.parameters().begin(), asked.parameters().end()},
            .body = std::string{asked.body()},
            .has_deadline = left > 0s && left < 60s,
            .trace = std::string{asked.trace()}};
}

void crash() {
    volatile int* nowhere = nullptr;
    *nowhere = 1; // NOLINT: this is what it is for
}

bool exists(const std::optional<std::string>& file) { return file && ::access(file->c_str(), F_OK) == 0; }

constexpr int control = 3; // the first lane is the next one

void until_stopped(const cles::responder& answer) {
    while (!answer.stopped()) {
        std::this_thread::sleep_for(1ms);
    }
}

// -- what ends the process -----------------------------------------------------------------------------------------

void insist(const cles::responder& answer, const cles::job_feed& from) {
    from.next([answer, from](boost::system::error_code, const cles::job_event&) { insist(answer, from); });
}
void persist(const cles::responder& answer) {
    const auto from = answer.bind("self:silent");
    from.next([answer, from](boost::system::error_code, const cles::job_event&) { persist(answer); });
}

void register_ends(cles::registrar& to) {
    to.on_delegate("crashes", [] { crash(); });
    to.on_delegate("aborts", [] { std::abort(); });
    to.on_delegate("exits", [](const cles::request& asked) { std::exit(asked.parameter<int>(0)); });
    to.on_delegate("kills_itself", [] {
        ::kill(::getpid(), SIGKILL);
        ::pause();
    });
    to.on_delegate("loops", [] {
        for (std::atomic<bool> forever{true}; forever;) {
        }
    });
    to.on_delegate("answers_and_loops", [](const cles::request&, const cles::responder& answer) {
        answer.progress(0.5);
        answer.done(1);
        for (std::atomic<bool> forever{true}; forever;) {
        }
    });
    to.on_delegate("closes_everything", [] {
        for (int fd = 3; fd < 64; ++fd) {
            ::close(fd);
        }
        std::this_thread::sleep_for(1h);
    });
    to.on_delegate("says_nonsense", [] {
        const std::string line = "id=99999999999999999999 nonsense\n";
        (void)::send(3, line.data(), line.size(), 0);
        std::this_thread::sleep_for(1h);
    });
    // Answers on the control connection, and then closes the lanes when it is told to.
    const auto told = std::make_shared<std::atomic<bool>>(false);
    to.on_delegate("closes_lanes", [told](const cles::request&, const cles::responder& answer) {
        answer.progress(0.5);
        answer.done(1);
        told->wait(false);
        for (int fd = control + 1; fd < 64; ++fd) {
            ::shutdown(fd, SHUT_RDWR);
        }
        std::this_thread::sleep_for(1h);
    });
    to.on_push("now", [told] {
        *told = true;
        told->notify_all();
    });
    to.on_delegate("closes_control", [] {
        ::shutdown(control, SHUT_WR);
        std::this_thread::sleep_for(1h);
    });
    to.on_delegate("drips", [] {
        for (;;) {
            for (int fd = control + 1; fd < 64; ++fd) {
                (void)::send(fd, "x", 1, MSG_DONTWAIT | MSG_NOSIGNAL);
            }
            std::this_thread::sleep_for(5ms);
        }
    });
    // Its handler returns, and nothing answers.
    to.on_delegate("keeps", [](const cles::request&, const cles::responder& answer) {
        static std::vector<cles::responder> kept;
        kept.push_back(answer);
    });
    // The same, with a feed that has ended.
    to.on_delegate("hoards", [](const cles::request&, const cles::responder& answer) {
        const auto from = answer.bind("self:silent");
        from.next([answer, from](boost::system::error_code, const cles::job_event&) {
            static std::vector<cles::responder> kept;
            kept.push_back(answer);
        });
    });
    // Goes on after its end: with the feed that has ended, or with another one.
    to.on_delegate("insists", [](const cles::request&, const cles::responder& answer) {
        insist(answer, answer.bind("self:silent"));
    });
    to.on_delegate("persists", [](const cles::request&, const cles::responder& answer) { persist(answer); });
    to.on_delegate("exhausts_memory", [] {
        std::vector<std::unique_ptr<char[]>> all;
        for (;;) {
            constexpr std::size_t size = 16U << 20U;
            all.push_back(std::make_unique<char[]>(size)); // written with zeros
        }
    });
}

// -- what it must not do -------------------------------------------------------------------------------------------

int outcome(long result) { return result < 0 ? errno : 0; }

// Numbers of signals, limits and such are arguments; the files are its own.
void register_calls(cles::registrar& to) {
    const auto on = [&to](const char* name, auto call) {
        to.on_pull(name, [call](const cles::request& asked) { return outcome(call(asked.parameter<int>(0))); });
    };
    on("limits", [](int process) { return ::prlimit(process, RLIMIT_CORE, nullptr, nullptr); });
    on("pins", [](int process) {
        cpu_set_t all;
        CPU_ZERO(&all);
        ::sched_getaffinity(0, sizeof all, &all);
        return ::sched_setaffinity(process, sizeof all, &all);
    });
    on("schedules", [](int process) {
        const sched_param usual{};
        return ::sched_setscheduler(process, SCHED_OTHER, &usual);
    });
    on("renices", [](int process) { return ::setpriority(PRIO_PROCESS, static_cast<id_t>(process), 19); });
    on("renices_group", [](int group) { return ::setpriority(PRIO_PGRP, static_cast<id_t>(group), 19); });
    on("sets_io_priority", [](int process) { return ::syscall(SYS_ioprio_set, 1, process, 0); });
    on("sets_owner", [](int process) { return ::fcntl(control, F_SETOWN, process); });
    on("sets_owner_by_ioctl", [](int process) { return ::ioctl(control, FIOSETOWN, &process); });
    on("sets_signal", [](int number) { return ::fcntl(control, F_SETSIG, number); });
    on("forks", [](int) {
        const auto child = ::fork();
        if (child == 0) {
            ::_exit(0);
        }
        return child;
    });
    on("clones", [](int) { return ::syscall(SYS_clone, CLONE_NEWUSER | SIGCHLD, 0, 0, 0, 0); });
    on("clones_3", [](int) { return ::syscall(SYS_clone3, nullptr, 0); });
    on("starts_a_thread", [](int) {
        std::thread{[] {}}.join();
        return 0;
    });
    on("begins_a_session", [](int) { return ::setsid(); });
    on("changes_group", [](int group) { return ::setpgid(0, group); });
    on("makes_memory", [](int) { return ::memfd_create("x", 0); });
    on("maps_memory", [](int shared) {
        const auto flags = MAP_ANONYMOUS | (shared != 0 ? MAP_SHARED : MAP_PRIVATE);
        auto* const made = ::mmap(nullptr, 4096, PROT_READ | PROT_WRITE, flags, -1, 0);
        return made == MAP_FAILED ? -1 : ::munmap(made, 4096);
    });
    on("shares_memory", [](int) { return ::shmget(IPC_PRIVATE, 4096, IPC_CREAT | 0600); });
    on("outlives", [](int) { return ::prctl(PR_SET_PDEATHSIG, 0); });
    on("changes_mode", [](int) { return ::chmod("/proc/self/exe", 0700); });
    on("changes_owner", [](int user) { return ::chown("/proc/self/exe", static_cast<uid_t>(user), 0); });
    on("changes_time", [](int) { return ::utimensat(AT_FDCWD, "/dev/null", nullptr, 0); });
    on("changes_attribute", [](int) { return ::setxattr("/dev/null", "user.x", "x", 1, 0); });
    on("opens_a_socket", [](int family) {
        const int fd = ::socket(family, SOCK_DGRAM | SOCK_CLOEXEC, 0);
        if (fd >= 0) {
            ::close(fd);
        }
        return fd;
    });
    on("opens_a_pair", [](int type) {
        int fds[2];
        const int failed = ::socketpair(AF_UNIX, type | SOCK_CLOEXEC, 0, fds);
        if (failed == 0) {
            ::close(fds[0]);
            ::close(fds[1]);
        }
        return failed;
    });
}

void register_attempts(cles::registrar& to) {
    to.on_pull("process", [] { return static_cast<int>(::getpid()); });
    to.on_pull("signals", [](const cles::request& asked) { return outcome(::kill(asked.parameter<int>(0), 0)); });
    to.on_pull("traces", [](const cles::request& asked) {
        return outcome(::ptrace(PTRACE_SEIZE, asked.parameter<int>(0), nullptr, nullptr));
    });
    to.on_pull("reads", [](const cles::request& asked) {
        const int fd = ::open(std::string{asked.parameter(0)}.c_str(), O_RDONLY | O_CLOEXEC);
        const int failed = outcome(fd);
        ::close(fd);
        return failed;
    });
    to.on_pull("writes", [](const cles::request& asked) {
        const int fd = ::open(std::string{asked.parameter(0)}.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
        const int failed = outcome(fd);
        ::close(fd);
        return failed;
    });
    register_calls(to);
    to.on_pull("variable", [](const cles::request& asked) {
        const char* value = std::getenv(std::string{asked.parameter(0)}.c_str());
        return std::string{value == nullptr ? "" : value};
    });
    // Not by the plugin's host, which would cut it.
    to.on_push("logs_much", [] {
        const auto line = R"(PUSH self:cles/log {"level":1,"text":"much )" + std::string(100'000, 'x') + "\"}\n";
        (void)::send(control, line.data(), line.size(), 0);
    });
    // Which descriptors it has, besides those of its output.
    to.on_pull("descriptors", [] {
        std::vector<int> open;
        for (int fd = 3; fd < 1024; ++fd) {
            if (::fcntl(fd, F_GETFD) >= 0) {
                open.push_back(fd);
            }
        }
        return open;
    });
    to.on_push("says", [](const cles::request& asked) {
        std::printf("%s\n", std::string{asked.parameter(0)}.c_str());
        std::fflush(stdout);
        std::fprintf(stderr, "%s too\n", std::string{asked.parameter(0)}.c_str());
    });
    to.on_push("says_much", [] {
        for (int i = 0; i < 20'000; ++i) {
            std::printf("line %d\n", i);
        }
        std::fflush(stdout);
    });
}

// -- what plugins do -----------------------------------------------------------------------------------------------

void register_replies(cles::registrar& to) {
    to.on_pull("quick", [] { return 42; }, {.description = "a number", .idempotent = true});
    to.on_pull("caller", describe, {.description = "who asks", .parameters = {"a", "b"}});
    to.on_push("caller", describe);
    to.on_delegate("caller", describe);
    to.on_pull("text", [] { return std::string{"a \"b\" \n \xC3\xA4"}; });
    to.on_pull("list", [] { return std::vector{1, 2, 3}; });
    to.on_push("swap", [](const point& p) { return point{p.y, p.x}; });
    to.on_push("nothing", [] {});
    to.on_pull("large", [] { return std::string(300'000, 'x'); });
    to.on_pull("too_large", [] { return std::string(2'000'000, 'x'); });
    to.on_pull("looks_failed", [] { return cles::json_text{R"({"error":"busy"})"}; });
    to.on_pull("throws", [] { throw std::runtime_error{"it broke"}; });
    to.on_pull("denies", [] { throw cles::error(cles::errc::denied, "not you"); });
    to.on_pull("refuses",
               [](const cles::request&, const cles::responder& answer) { answer.refuse("the dock is full", 250ms); });
    to.on_pull("forgets", [](const cles::request&, const cles::responder&) {});
    to.on_pull("twice", [](const cles::request&, const cles::responder& answer) {
        answer.done(1);
        answer.done(2);
    });
    to.on_pull("later", [](const cles::request&, const cles::responder& answer) {
        std::thread{[answer] {
            std::this_thread::sleep_for(5ms);
            answer.done("late");
        }}.detach();
    });
    to.on_delegate("reports", [](const cles::request&, const cles::responder& answer) {
        for (int i = 1; i <= 4; ++i) {
            answer.progress(i / 4.0, point{static_cast<double>(i), 0});
        }
        answer.done("done");
    });
    to.on_delegate("reports_much", [](const cles::request&, const cles::responder& answer) {
        for (int i = 1; i <= 50'000; ++i) {
            answer.progress(i / 50'000.0);
        }
        answer.done("done");
    });
}

// Reports three events, and then how many they were.
void follow(const cles::responder& answer, const cles::job_feed& from, int count) {
    from.next([answer, from, count](boost::system::error_code code, const cles::job_event& event) {
        if (code) {
            answer.fail(static_cast<cles::errc>(code.value()), event.text);
            return;
        }
        answer.progress(
            0, point{static_cast<double>(event.has_value() ? event.as<int>() : -1), static_cast<double>(event.missed)});
        if (count == 3) {
            answer.done(count);
        } else {
            follow(answer, from, count + 1);
        }
    });
}

void register_jobs(cles::registrar& to) {
    // Until the request is cancelled or its deadline has passed. Counts how often that happened, and how.
    struct ends {
        std::atomic<int> stopped{0}, called{0}, begun{0};
    };
    const auto counts = std::make_shared<ends>();
    to.on_pull("stops", [counts] {
        return std::vector{counts->stopped.load(), counts->called.load(), counts->begun.load()};
    });
    to.on_delegate("waits", [counts](const cles::request&, const cles::responder& answer) {
        answer.on_stop([counts] { ++counts->called; });
        ++counts->begun;
        until_stopped(answer);
        ++counts->stopped;
        answer.fail(cles::errc::cancelled, "stopped");
    });
    // Its handler returns at once.
    to.on_delegate("listens", [counts](const cles::request&, const cles::responder& answer) {
        answer.on_stop([counts, answer] {
            ++counts->called;
            answer.fail(cles::errc::cancelled, "stopped");
        });
        ++counts->begun;
    });
    to.on_delegate("follows", [](const cles::request& asked, const cles::responder& answer) {
        follow(answer, answer.bind(asked.parameter(0)), 1);
    });
    // What the first event of a feed says about itself. Its parameters are the noun and the number of hops.
    to.on_delegate("marks", [](const cles::request& asked, const cles::responder& answer) {
        const auto how = cles::bind_options{}.mark().hops(asked.parameter<unsigned>(1));
        const auto from = answer.bind(asked.parameter(0), how);
        from.next([answer, from](boost::system::error_code code, const cles::job_event& event) {
            if (code) {
                answer.fail(static_cast<cles::errc>(code.value()), event.text);
            } else {
                answer.done(std::vector<std::uint64_t>{event.seq, event.epoch != 0 ? 1U : 0U});
            }
        });
    });
    // Asks for an event after its answer, and does not return at once. Counts the events, and those that have come
    // before it had returned.
    struct late_events {
        std::atomic<int> all{0}, early{0};
        std::atomic<bool> in_handler{false};
    };
    const auto late = std::make_shared<late_events>();
    to.on_delegate("answers_first", [late](const cles::request&, const cles::responder& answer) {
        late->in_handler = true;
        const auto from = answer.bind("self:silent");
        answer.done(1);
        from.next([late](boost::system::error_code, const cles::job_event&) {
            late->early += late->in_handler ? 1 : 0;
            ++late->all;
        });
        for (int i = 0; i < 20 && late->all == 0; ++i) {
            std::this_thread::sleep_for(1ms);
        }
        late->in_handler = false;
    });
    // Its callback comes while its handler runs, and does not return before it is released.
    const auto released = std::make_shared<std::atomic<bool>>(false);
    to.on_delegate("asks_after_its_answer", [released](const cles::request&, const cles::responder& answer) {
        const auto from = answer.bind("self:silent");
        answer.done(1);
        from.next([released](boost::system::error_code, const cles::job_event&) {
            while (!*released) {
                std::this_thread::sleep_for(1ms);
            }
        });
        std::this_thread::sleep_for(20ms);
    });
    to.on_push("release", [released] { *released = true; });
    to.on_pull("late_events", [late] { return std::vector{late->all.load(), late->early.load()}; });
    to.on_delegate("ages", [](const cles::request& asked) {
        std::this_thread::sleep_for(std::chrono::milliseconds{asked.parameter<int>(0)});
        return "aged";
    });
    // Passes on a command, and reports the progress of it.
    to.on_delegate("passes_on", [](const cles::request& asked, const cles::responder& answer) {
        const auto command = std::string{asked.parameter(0)};
        answer.delegate(
            command,
            cles::call_options{}.on_progress([answer](double done, std::string_view) { answer.progress(done / 2); }),
            [answer](boost::system::error_code code, std::string_view json, std::string_view message) {
                if (code) {
                    answer.fail(cles::errc::failed, std::string{code.message()} + ": " + std::string{message});
                } else {
                    answer.done(cles::json_text{std::string{json}});
                }
            });
    });
}

void register_updates(cles::registrar& to) {
    const auto updates = std::make_shared<cles::publisher>(to.make_publisher());
    updates->update("topic/0", "first");
    to.on_push("publish", [updates](const cles::request& asked) {
        updates->update("topic/" + std::string{asked.parameter(0)}, asked.parameter<int>(0));
    });
    to.on_push("publish_elsewhere", [updates] { updates->update("prime/1", 1); });
    to.on_push("publish_many", [updates](const cles::request& asked) {
        for (int i = 0; i < asked.parameter<int>(0); ++i) {
            updates->update("topic/" + std::to_string(i), i);
        }
    });
    to.on_bind("topic", [](const cles::request& asked) {
        if (asked.parameters().empty()) {
            throw cles::error(cles::errc::bad_request, "which one?");
        }
    });
    to.on_update("notice", [](const cles::request& asked) {
        if (asked.body() == "{}") {
            throw cles::error(cles::errc::bad_request, "say something");
        }
    });
    to.on_bind("silent");
}

// Said when the plugin stops.
struct last_words {
    explicit last_words(bool are_wanted) : wanted(are_wanted) {}
    last_words(last_words&& other) noexcept : wanted(std::exchange(other.wanted, false)) {}
    last_words(const last_words&) = default;
    last_words& operator=(const last_words&) = delete;
    ~last_words() {
        if (wanted) {
            for (int i = 0; i < 20'000; ++i) {
                std::printf("last word %d\n", i);
            }
            std::fflush(stdout);
        }
    }
    bool wanted;
};

void register_tasks(cles::registrar& to, const settings& how) {
    if (how.crash_at_start.value_or(false) || exists(how.crash_while)) {
        std::fputs("about to crash\n", stderr);
        crash();
    }
    if (exists(how.slow_while)) {
        char first = 0;
        (void)::recv(control, &first, 1, MSG_PEEK);
    }
    to.on_pull("padding", [size = how.padding.value_or("").size()] { return size; });
    to.on_pull("last_words", [words = last_words{how.talk_at_stop.value_or(false)}] { return words.wanted; });
    register_ends(to);
    register_attempts(to);
    register_replies(to);
    register_jobs(to);
    register_updates(to);
}

} // namespace

CLES_PLUGIN("hostile", "1.0", register_tasks)
