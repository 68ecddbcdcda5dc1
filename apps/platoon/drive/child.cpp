// SPDX-License-Identifier: BSL-1.0
#include "platoon/drive/child.hpp"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

namespace platoon {
namespace {

[[noreturn]] void fail(const char* what) { throw std::system_error(errno, std::generic_category(), what); }

/// What a child has from its parent.
struct surroundings {
    int out = -1, err = -1;
    int network = -1; ///< -1: the parent's
    const std::vector<int>& inherited;
    pid_t parent = -1;
    const sigset_t& unblocked;
};

// Between fork and exec: nothing but system calls.
[[noreturn]] void exec_child(std::vector<char*>& words, const surroundings& in) {
    ::signal(SIGTERM, SIG_DFL);
    ::pthread_sigmask(SIG_SETMASK, &in.unblocked, nullptr);
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (::getppid() != in.parent) {
        ::_exit(127); // the parent has ended meanwhile
    }
    if (in.network >= 0 && ::setns(in.network, CLONE_NEWNET) != 0) {
        const char* const why = ::strerrordesc_np(errno);
        for (const std::string_view part : {"its network cannot be entered: ", why != nullptr ? why : "?", "\n"}) {
            [[maybe_unused]] const auto written = ::write(in.err, part.data(), part.size());
        }
        ::_exit(127);
    }
    for (const int each : in.inherited) {
        ::fcntl(each, F_SETFD, 0);
    }
    const int nothing = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    ::dup2(nothing, STDIN_FILENO);
    ::dup2(in.out, STDOUT_FILENO);
    ::dup2(in.err, STDERR_FILENO);
    ::setpgid(0, 0); // a terminal sends SIGINT to the whole group, but the parent stops its children itself
    ::execv("/proc/self/exe", words.data());
    ::_exit(127);
}

} // namespace

child::child(const std::vector<std::string>& arguments, int network, const std::vector<int>& inherited) {
    out_ = ::memfd_create("output", MFD_CLOEXEC);
    err_ = ::memfd_create("errors", MFD_CLOEXEC);
    if (out_ < 0 || err_ < 0) {
        fail("a vehicle's output");
    }
    std::vector<std::string> owned{"cles-platoon"};
    owned.insert(owned.end(), arguments.begin(), arguments.end());
    std::vector<char*> words;
    words.reserve(owned.size() + 1);
    for (auto& word : owned) {
        words.push_back(word.data());
    }
    words.push_back(nullptr);
    const pid_t parent = ::getpid();
    // The child has this process's handlers until it runs its own program. They would note there that this one is to
    // end.
    sigset_t terminate{};
    sigset_t unblocked{};
    ::sigaddset(&terminate, SIGTERM);
    ::pthread_sigmask(SIG_BLOCK, &terminate, &unblocked);
    pid_ = ::fork();
    if (pid_ == 0) {
        exec_child(words, {.out = out_,
                           .err = err_,
                           .network = network,
                           .inherited = inherited,
                           .parent = parent,
                           .unblocked = unblocked});
    }
    ::pthread_sigmask(SIG_SETMASK, &unblocked, nullptr);
    if (pid_ < 0) {
        fail("a vehicle's process");
    }
}

child::child(child&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)), ended_(other.ended_), status_(other.status_),
      out_(std::exchange(other.out_, -1)), err_(std::exchange(other.err_, -1)) {}

child::~child() {
    if (running()) {
        signal(SIGKILL);
        ::waitpid(pid_, &status_, 0);
    }
    for (const int file : {out_, err_}) {
        if (file >= 0) {
            ::close(file);
        }
    }
}

bool child::running() {
    if (pid_ > 0 && !ended_) {
        ended_ = ::waitpid(pid_, &status_, WNOHANG) == pid_;
    }
    return pid_ > 0 && !ended_;
}

void child::signal(int number) const {
    if (pid_ > 0 && !ended_) {
        ::kill(pid_, number);
    }
}

std::string child::read(int file) {
    std::string text;
    std::array<char, 65536> part{};
    for (ssize_t got = 0; (got = ::pread(file, part.data(), part.size(), static_cast<off_t>(text.size()))) > 0;) {
        text.append(part.data(), static_cast<std::size_t>(got));
    }
    return text;
}

} // namespace platoon
