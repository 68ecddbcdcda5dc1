// SPDX-License-Identifier: BSL-1.0
// In steady state, a PULL costs the service at most four system calls: wait, receive, send, and a receive that finds
// nothing. The service is a child that this process traces; this process is also its client, and sends the next
// request only when the service is about to wait, so that the number of calls does not depend on timing.
#include <cles/service.hpp>

#include "scripted_client.hpp"

#include <boost/asio/io_context.hpp>

#include <array>
#include <csignal>
#include <cstdio>
#include <exception>
#include <map>
#include <memory>
#include <string>

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/wait.h>

namespace {

constexpr int skipped = 77;
constexpr int warm_up = 200;
constexpr int counted = 2'000;
constexpr int allowed_per_pull = 4;

[[noreturn]] void serve(int announce_to) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    try {
        boost::asio::io_context io{1};
        cles::service car{io, {.name = "car1", .listen = {"tcp://127.0.0.1:0"}}};
        car.on_pull("localization", [] { return localization{}; });
        const auto endpoint = car.endpoints().front() + "\n";
        if (::write(announce_to, endpoint.data(), endpoint.size()) < 0 ||
            ::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0) {
            ::_exit(skipped);
        }
        ::raise(SIGSTOP);
        io.run();
    } catch (const std::exception& failure) {
        std::fprintf(stderr, "service: %s\n", failure.what());
    }
    ::_exit(1);
}

const char* name_of(unsigned long long call) {
    switch (call) {
#ifdef SYS_epoll_wait
    case SYS_epoll_wait: return "epoll_wait";
#endif
    case SYS_epoll_pwait: return "epoll_pwait";
    case SYS_epoll_ctl: return "epoll_ctl";
    case SYS_recvfrom: return "recvfrom";
    case SYS_recvmsg: return "recvmsg";
    case SYS_read: return "read";
    case SYS_readv: return "readv";
    case SYS_sendto: return "sendto";
    case SYS_sendmsg: return "sendmsg";
    case SYS_write: return "write";
    case SYS_writev: return "writev";
    case SYS_timerfd_settime: return "timerfd_settime";
    case SYS_clock_gettime: return "clock_gettime";
    case SYS_futex: return "futex";
    default: return "another";
    }
}

/// Whether the service is about to wait without a limit.
bool is_wait(const __ptrace_syscall_info& info) {
    const auto call = info.entry.nr;
    bool waits = call == SYS_epoll_pwait;
#ifdef SYS_epoll_wait
    waits = waits || call == SYS_epoll_wait;
#endif
    return waits && static_cast<int>(info.entry.args[3]) != 0;
}

bool is_send(const __ptrace_syscall_info& info) {
    const auto call = info.entry.nr;
    return call == SYS_sendto || call == SYS_sendmsg || call == SYS_write || call == SYS_writev;
}

class traced_service {
  public:
    traced_service() {
        std::array<int, 2> ends{};
        if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
            throw std::system_error(errno, std::generic_category(), "pipe");
        }
        id_ = ::fork();
        if (id_ < 0) {
            throw std::system_error(errno, std::generic_category(), "fork");
        }
        if (id_ == 0) {
            serve(ends[1]);
        }
        ::close(ends[1]);
        for (char byte = 0; ::read(ends[0], &byte, 1) == 1 && byte != '\n';) {
            url_.push_back(byte);
        }
        ::close(ends[0]);
    }
    traced_service(const traced_service&) = delete;
    traced_service& operator=(const traced_service&) = delete;
    ~traced_service() {
        ::kill(id_, SIGKILL);
        ::waitpid(id_, nullptr, __WALL);
    }

    [[nodiscard]] const std::string& url() const { return url_; }

    /// False if this system does not permit tracing.
    bool attach() {
        int status = 0;
        ::waitpid(id_, &status, 0);
        return WIFSTOPPED(status) && ::ptrace(PTRACE_SETOPTIONS, id_, nullptr, PTRACE_O_TRACESYSGOOD) == 0;
    }

    /// Runs it up to the entry of its next system call. False if the kernel cannot report which one it is.
    bool next_call(__ptrace_syscall_info& info) {
        for (;;) {
            resume();
            int status = 0;
            if (::waitpid(id_, &status, 0) != id_ || !WIFSTOPPED(status)) {
                throw std::runtime_error("the service ended");
            }
            if (WSTOPSIG(status) != (SIGTRAP | 0x80)) {
                continue;
            }
            if (::ptrace(PTRACE_GET_SYSCALL_INFO, id_, sizeof info, &info) <= 0) {
                return false;
            }
            if (info.op == PTRACE_SYSCALL_INFO_ENTRY) {
                return true;
            }
        }
    }

  private:
    void resume() const {
        if (::ptrace(PTRACE_SYSCALL, id_, nullptr, nullptr) != 0) {
            throw std::system_error(errno, std::generic_category(), "PTRACE_SYSCALL");
        }
    }

    pid_t id_ = -1;
    std::string url_;
};

int run() {
    traced_service service;
    if (!service.attach()) {
        std::puts("skipped: this system does not let a process trace its child");
        return skipped;
    }
    // The listening socket accepts the connection before the service continues.
    scripted_client client{service.url()};

    std::map<unsigned long long, int> calls;
    int pulls = 0;
    bool asked = false;
    bool sent = false; // since the last request: its reply is on the way
    for (__ptrace_syscall_info info{}; pulls < warm_up + counted;) {
        if (!service.next_call(info)) {
            std::puts("skipped: this kernel does not tell which system call a traced process makes");
            return skipped;
        }
        if (pulls >= warm_up) {
            ++calls[info.entry.nr];
        }
        sent = sent || is_send(info);
        if (!is_wait(info)) {
            continue;
        }
        if (asked) {
            if (!client.has_line(sent ? 1000 : 0)) {
                continue; // it has not read the request yet
            }
            if (const auto reply = client.receive_line(); reply.find("\"lat\":48.137154") == std::string::npos) {
                throw std::runtime_error("an unexpected reply: " + reply);
            }
            ++pulls;
        }
        // It has not entered the kernel yet: the request arrives while it waits, or just before.
        client.send("PULL car1:localization id=" + std::to_string(pulls + 1) + " deadline=5000\n");
        asked = true;
        sent = false;
    }

    int total = 0;
    for (const auto& [call, count] : calls) {
        std::printf("%-16s (%3llu)  %.3f\n", name_of(call), call, static_cast<double>(count) / counted);
        total += count;
    }
    const double each = static_cast<double>(total) / counted;
    std::printf("system calls for each PULL: %.3f, allowed are %d\n", each, allowed_per_pull);
    // Occasional calls, such as setting a timer again, may add a hundredth.
    return each <= allowed_per_pull + 0.01 ? 0 : 1;
}

} // namespace

int main() {
    try {
        return run();
    } catch (const std::exception& failure) {
        std::printf("failed: %s\n", failure.what());
        return 1;
    }
}
