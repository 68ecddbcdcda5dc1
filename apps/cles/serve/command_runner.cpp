// SPDX-License-Identifier: BSL-1.0
#include "serve/command_runner.hpp"

#include <cles/convert.hpp>
#include <cles/jobs.hpp>

#include "serve/child_process.hpp"
#include "serve/command_outcome.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <system_error>
#include <utility>

namespace tool {

struct command_runner::job {
    job(const cles::request& request, const cles::responder& to) : what(request), answer(to) {}

    const cles::request what; // a copy, which owns its text
    const cles::responder answer;
    std::shared_ptr<child_process> process{}; // null: it waits
    bool is_withdrawn = false;
};

command_runner::command_runner(boost::asio::io_context& io, settings how, log_function log)
    : io_(io), how_(std::move(how)), log_(std::move(log)) {}

void command_runner::answer(const cles::request& what, const cles::responder& to) {
    if (!how_.takes_parameters && !what.parameters().empty()) {
        to.fail(cles::errc::bad_request, "'" + std::string{what.task()} + "' takes no parameters");
        return;
    }
    if (stopped_ || waiting_.size() >= most_waiting) {
        to.refuse(stopped_ ? "it is shutting down" : "too many requests wait", std::chrono::seconds{1});
        return;
    }
    const auto made = std::make_shared<job>(what, to);
    waiting_.push_back(made);
    // The job owns the responder, which keeps these functions: weak references break the cycle.
    to.on_stop([weak = weak_from_this(), of = std::weak_ptr{made}] {
        const auto self = weak.lock();
        const auto ended = of.lock();
        if (self && ended) {
            self->withdraw(ended);
        }
    });
    cles::tell_job_status(to, [of = std::weak_ptr{made}] {
        const auto known = of.lock();
        return cles::job_status{.waiting = known && !known->process};
    });
    start_more();
}

void command_runner::start_more() {
    while (!stopped_ && running_.size() < how_.at_once && !waiting_.empty()) {
        const auto next = std::move(waiting_.front());
        waiting_.pop_front();
        start(next);
    }
}

void command_runner::start(const std::shared_ptr<job>& what) {
    auto words = how_.words;
    if (how_.takes_parameters) {
        words.emplace_back("--");
        for (const auto parameter : what->what.parameters()) {
            words.emplace_back(parameter);
        }
    }
    const auto on_end = [weak = weak_from_this(), what](const finished_command& ended) {
        const auto self = weak.lock();
        if (!self) {
            return;
        }
        self->running_.erase(what);
        if (!what->is_withdrawn) {
            const auto outcome = outcome_of(ended);
            if (outcome.failure) {
                what->answer.fail(*outcome.failure, outcome.text);
            } else {
                what->answer.done(cles::json_text{outcome.text});
            }
        }
        self->start_more();
    };
    try {
        what->process = child_process::start(io_, words, std::string{what->what.body()}, on_end);
        running_.insert(what);
    } catch (const std::system_error& e) {
        if (e.code().value() == E2BIG) { // the requester's doing, so not worth a line in the log
            what->answer.fail(cles::errc::too_large, "the parameters are too long for a command");
            return;
        }
        log_(cles::log_level::error, "'" + how_.words.front() + "': " + e.what());
        what->answer.fail(cles::errc::failed, "the command cannot be started");
    }
}

void command_runner::withdraw(const std::shared_ptr<job>& what) {
    what->is_withdrawn = true;
    if (what->process) {
        what->process->stop(); // its place is free when it has ended
    } else {
        waiting_.erase(std::remove(waiting_.begin(), waiting_.end(), what), waiting_.end());
    }
}

void command_runner::stop() {
    stopped_ = true;
    for (const auto& each : running_) {
        each->process->kill();
    }
    for (const auto& each : std::exchange(waiting_, {})) {
        each->answer.refuse("it is shutting down", std::chrono::seconds{1});
    }
}

} // namespace tool
