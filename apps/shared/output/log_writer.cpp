// SPDX-License-Identifier: BSL-1.0
#include "output/log_writer.hpp"

#include "output/log_queue.hpp"

#include <cerrno>
#include <condition_variable>
#include <csignal>
#include <mutex>
#include <string_view>
#include <utility>

#include <poll.h>
#include <unistd.h>

namespace tool {
namespace {

// Waits as long as it takes. Returns how much of the text was written before an error.
std::size_t write_until_error(int descriptor, std::string_view text) noexcept {
    std::size_t written = 0;
    while (written < text.size()) {
        const auto more = ::write(descriptor, text.data() + written, text.size() - written);
        if (more >= 0) {
            written += static_cast<std::size_t>(more);
        } else if (errno == EAGAIN) { // another process that shares the pipe made it non-blocking
            pollfd out{descriptor, POLLOUT, 0};
            ::poll(&out, 1, -1);
        } else if (errno != EINTR) {
            break;
        }
    }
    return written;
}

// A thread that takes no signals: the program's handlers run where they would without it.
template <class Function>
std::thread thread_without_signals(Function function) {
    sigset_t all;
    sigset_t before;
    ::sigfillset(&all);
    ::pthread_sigmask(SIG_SETMASK, &all, &before);
    struct restorer {
        const sigset_t& mask;
        ~restorer() { ::pthread_sigmask(SIG_SETMASK, &mask, nullptr); }
    } const restore{before};
    return std::thread{std::move(function)};
}

} // namespace

struct log_writer::shared {
    shared(int to, std::function<std::string(std::uint64_t)> made) : descriptor(to), dropped_line(std::move(made)) {}

    const int descriptor;
    const std::function<std::string(std::uint64_t)> dropped_line;
    std::mutex mutex; // of all that follows
    std::condition_variable added;
    std::condition_variable written;
    log_queue queue;
    bool writes = false; // lines that are not in the queue any more
    bool closed = false;
    bool has_ended = false;
};

log_writer::log_writer(stream to, std::function<std::string(std::uint64_t)> dropped)
    : shared_(std::make_shared<shared>(static_cast<int>(to), std::move(dropped))),
      thread_(thread_without_signals([all = shared_] { run(all); })) {}

void log_writer::write(std::string line) {
    {
        const std::scoped_lock lock{shared_->mutex};
        if (shared_->closed) {
            return;
        }
        shared_->queue.add(std::move(line));
    }
    shared_->added.notify_one();
}

void log_writer::flush() {
    std::unique_lock lock{shared_->mutex};
    shared_->written.wait_for(lock, last_wait, [this] { return shared_->queue.empty() && !shared_->writes; });
}

void log_writer::close() {
    if (!thread_.joinable()) {
        return;
    }
    std::unique_lock lock{shared_->mutex};
    shared_->closed = true;
    shared_->added.notify_one();
    const bool has_ended = shared_->written.wait_for(lock, last_wait, [this] { return shared_->has_ended; });
    lock.unlock();
    if (has_ended) {
        thread_.join();
    } else {
        thread_.detach(); // it waits for the reader, and ends with the process
    }
}

void log_writer::run(const std::shared_ptr<shared>& all) {
    std::uint64_t lost = 0; // lines that were dropped, or not written, and have not been reported
    bool in_line = false;   // an error has ended the last line before its LF
    const auto put = [&](const std::string& line) {
        const auto text = in_line ? "\n" + line : line;
        const auto written = write_until_error(all->descriptor, text);
        in_line = written == 0 ? in_line : written < text.size();
        return written == text.size();
    };
    std::unique_lock lock{all->mutex};
    for (;;) {
        all->added.wait(lock, [&] { return all->closed || !all->queue.empty(); });
        const auto next = all->queue.take();
        if (!next) {
            break;
        }
        all->writes = true;
        lock.unlock();
        lost += next->dropped;
        if (lost > 0 && put(all->dropped_line(lost))) {
            lost = 0;
        }
        if (!next->line.empty() && !put(next->line)) {
            ++lost;
        }
        lock.lock();
        all->writes = false;
        all->written.notify_all();
    }
    all->has_ended = true;
    all->written.notify_all();
}

} // namespace tool
