// SPDX-License-Identifier: BSL-1.0
#include "child_process.hpp"

#include "pinning.hpp"

#include <array>
#include <csignal>
#include <cstddef>
#include <exception>
#include <stdexcept>

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>

namespace cles::perf {
namespace {

// A message is one line, marked by its first byte.
constexpr char good = '+';
constexpr char bad = '!';

void write_line(int to, char mark, std::string_view text) {
    std::string line{mark};
    line.append(text).push_back('\n');
    std::size_t written = 0;
    while (written < line.size()) {
        const auto taken = ::write(to, line.data() + written, line.size() - written);
        if (taken < 0 && errno != EINTR) {
            return; // the parent has ended, and this process will end with it
        }
        written += taken < 0 ? 0 : static_cast<std::size_t>(taken);
    }
}

int run_child(int core, const child_process::work& run, int to_parent) {
    try {
        pin_to(core);
        run([&](std::string_view text) { write_line(to_parent, good, text); });
        return 0;
    } catch (const std::exception& failure) {
        write_line(to_parent, bad, failure.what());
        return 1;
    }
}

} // namespace

child_process::child_process(int core, const work& run) {
    std::array<int, 2> ends{};
    checked(::pipe2(ends.data(), O_CLOEXEC), "pipe");
    from_child_ = descriptor{ends[0]};
    descriptor to_parent{ends[1]};
    const auto parent = ::getpid();
    id_ = checked(::fork(), "fork");
    if (id_ == 0) {
        from_child_.reset();
        ::prctl(PR_SET_PDEATHSIG, SIGKILL);
        // The parent may have ended before the prctl.
        const int result = ::getppid() == parent ? run_child(core, run, to_parent.get()) : 1;
        // What is in the buffers of the parent must not be written twice.
        ::_exit(result);
    }
}

child_process::~child_process() {
    ::kill(id_, SIGKILL);
    while (::waitpid(id_, nullptr, 0) < 0 && errno == EINTR) {
    }
}

std::string child_process::announced() {
    std::string line;
    char byte = 0;
    for (;;) {
        const auto got = ::read(from_child_.get(), &byte, 1);
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (checked(got, "read from the server process") == 0) {
            throw std::runtime_error("the server process ended before it announced anything");
        }
        if (byte == '\n') {
            break;
        }
        line.push_back(byte);
    }
    if (line.front() == bad) {
        throw std::runtime_error("the server process failed: " + line.substr(1));
    }
    return line.substr(1);
}

} // namespace cles::perf
