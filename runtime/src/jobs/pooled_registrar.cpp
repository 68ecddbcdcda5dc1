// SPDX-License-Identifier: BSL-1.0
#include "jobs/pooled_registrar.hpp"

#include "jobs/current_trace.hpp"

#include <chrono>
#include <memory>
#include <string_view>
#include <utility>

namespace cles::runtime {
namespace {

/// Reports its own lifetime to the dispatcher, even if an exception passes.
class inline_timer {
  public:
    inline_timer(job_dispatcher& dispatcher, std::string_view task) noexcept : dispatcher_(dispatcher), task_(task) {}
    inline_timer(const inline_timer&) = delete;
    inline_timer& operator=(const inline_timer&) = delete;
    ~inline_timer() { dispatcher_.record_inline_call(task_, std::chrono::steady_clock::now() - begun_); }

  private:
    job_dispatcher& dispatcher_;
    std::string_view task_;
    std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
};

} // namespace

void pooled_registrar::add(registration task) {
    const auto time_inline = [this](auto& handler) {
        if (handler) {
            handler = [timed = std::move(handler), dispatcher = dispatcher_](const request& r, auto&& reply) {
                const inline_timer timer{*dispatcher, r.task()};
                const current_trace during{r.trace()};
                timed(r, std::forward<decltype(reply)>(reply));
            };
        }
    };
    if (task.info.inline_ok || task.coroutine) {
        time_inline(task.plain);
        time_inline(task.async);
    } else if (task.plain || task.async) {
        auto work = std::make_shared<const registration>(
            registration{.plain = std::exchange(task.plain, nullptr), .async = std::exchange(task.async, nullptr)});
        task.async = [dispatcher = dispatcher_, work = std::move(work)](const request& r, responder answer) {
            dispatcher->submit(r, std::move(answer), work);
        };
    }
    host_.add(std::move(task));
}

publisher pooled_registrar::make_publisher() { return host_.make_publisher(); }

} // namespace cles::runtime
