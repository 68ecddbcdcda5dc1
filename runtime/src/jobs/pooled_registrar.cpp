// SPDX-License-Identifier: BSL-1.0
#include "jobs/pooled_registrar.hpp"

#include "jobs/job_dispatcher.hpp"

#include <chrono>
#include <utility>

namespace cles::runtime {
namespace {

/// Tells the pool how long it lived, whatever is thrown meanwhile.
class stopwatch {
  public:
    stopwatch(pool_state& tells, std::string_view task) noexcept : tells_(tells), task_(task) {}
    stopwatch(const stopwatch&) = delete;
    stopwatch& operator=(const stopwatch&) = delete;
    ~stopwatch() { tells_.note_inline(task_, std::chrono::steady_clock::now() - begun_); }

  private:
    pool_state& tells_;
    std::string_view task_;
    std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
};

} // namespace

void pooled_registrar::add(registration task) {
    if (task.info.inline_ok || task.coroutine) {
        add_inline(std::move(task));
    } else if (task.plain) {
        add_work(task.verb, std::move(task.task), std::move(task.info),
                 [handler = std::move(task.plain)](const job_context& job) {
                     job.answer_last([&](json_writer& w) { handler(job.request(), w); });
                 });
    } else if (task.async) {
        add_work(
            task.verb, std::move(task.task), std::move(task.info),
            [handler = std::move(task.async)](const job_context& job) { handler(job.request(), job.as_responder()); });
    } else {
        host_.add(std::move(task));
    }
}

void pooled_registrar::add_inline(registration task) {
    if (task.plain) {
        task.plain = [handler = std::move(task.plain), state = state_](const request& r, json_writer& w) {
            const stopwatch timed{*state, r.task()};
            handler(r, w);
        };
    }
    if (task.async) {
        task.async = [handler = std::move(task.async), state = state_](const request& r, responder answer) {
            const stopwatch timed{*state, r.task()};
            handler(r, std::move(answer));
        };
    }
    host_.add(std::move(task));
}

void pooled_registrar::add_work(cles::verb verb, std::string task, task_info info, job_work work) {
    registration entry{.verb = verb, .task = std::move(task), .info = std::move(info)};
    entry.async = [state = state_, work = std::make_shared<const job_work>(std::move(work))](const request& r,
                                                                                             responder answer) {
        state->submit({.what = r, .answer = std::move(answer), .work = work});
    };
    host_.add(std::move(entry));
}

publisher pooled_registrar::make_publisher() { return host_.make_publisher(); }

} // namespace cles::runtime
