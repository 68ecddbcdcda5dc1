// SPDX-License-Identifier: BSL-1.0
#include "serve/demo_tasks.hpp"

#include <cles/registrar.hpp>
#include <cles/request.hpp>
#include <cles/responder.hpp>
#include <cles/types.hpp>

#include <boost/asio/steady_timer.hpp>
#include <boost/describe.hpp>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace tool {
namespace {

struct echo_result {
    std::vector<std::string> parameters;
};
BOOST_DESCRIBE_STRUCT(echo_result, (), (parameters))

struct sleep_result {
    std::int64_t slept_ms = 0;
};
BOOST_DESCRIBE_STRUCT(sleep_result, (), (slept_ms))
CLES_FIELD(sleep_result, slept_ms, "ms", "how long it has waited")

constexpr std::int64_t max_ms = 86'400'000; // a day, the maximum of any deadline
constexpr int parts = 10;

/// DELEGATE sleep/<ms>: waits, reports progress, and can be cancelled.
class sleep_job : public std::enable_shared_from_this<sleep_job> {
  public:
    /// \throws cles::error with `bad_request` if the parameter is not a duration
    static void start(const cles::request& request, cles::responder answer);

    sleep_job(std::chrono::milliseconds span, cles::responder answer);

  private:
    void wait_a_tenth();

    std::chrono::milliseconds span_;
    cles::responder answer_;
    boost::asio::steady_timer timer_;
    std::chrono::steady_clock::time_point start_;
    int tenths_ = 0;
};

void sleep_job::start(const cles::request& request, cles::responder answer) {
    if (request.parameters().size() != 1) {
        throw cles::error(cles::errc::bad_request, "sleep takes one parameter, milliseconds, as in sleep/500");
    }
    const auto ms = request.parameter<std::int64_t>(0);
    if (ms < 0 || ms > max_ms) {
        throw cles::error(cles::errc::bad_request, "parameter 1 must be 0 to 86400000 milliseconds");
    }
    const auto job = std::make_shared<sleep_job>(std::chrono::milliseconds{ms}, answer);
    // The job owns the responder, which keeps this callback: a weak reference breaks the cycle.
    answer.on_stop([weak = std::weak_ptr{job}] {
        if (const auto running = weak.lock()) {
            running->timer_.cancel();
        }
    });
    job->wait_a_tenth();
}

sleep_job::sleep_job(std::chrono::milliseconds span, cles::responder answer)
    : span_(span), answer_(std::move(answer)), timer_(answer_.get_executor()),
      start_(std::chrono::steady_clock::now()) {}

void sleep_job::wait_a_tenth() {
    timer_.expires_at(start_ + span_ * (tenths_ + 1) / parts);
    timer_.async_wait([self = shared_from_this()](boost::system::error_code code) {
        if (code || self->answer_.stopped()) {
            self->answer_.fail(cles::errc::cancelled, "stopped");
            return;
        }
        if (++self->tenths_ == parts) {
            self->answer_.done(sleep_result{self->span_.count()});
            return;
        }
        self->answer_.progress(static_cast<double>(self->tenths_) / parts);
        self->wait_a_tenth();
    });
}

} // namespace

void register_demo_tasks(cles::registrar& to) {
    cles::typed_registrar tasks{to};
    const auto body = [](const cles::request& r) { return cles::json_text{std::string{r.body()}}; };
    tasks.on_pull("echo",
                  [](const cles::request& r) {
                      return echo_result{{r.parameters().begin(), r.parameters().end()}};
                  },
                  {.description = "Returns its parameters", .parameters = {"any"}, .idempotent = true});
    tasks.on_push("echo", body, {.description = "Returns its body", .idempotent = true});
    tasks.on_delegate("echo", body, {.description = "Returns its body", .idempotent = true});
    tasks.on_delegate("sleep",
                      [](const cles::request& r, cles::responder answer) { sleep_job::start(r, std::move(answer)); },
                      {.description = "Waits that many milliseconds, and reports progress in tenths",
                       .parameters = {"ms"},
                       .idempotent = true},
                      {.result = cles::schema_of<sleep_result>()});
    tasks.on_delegate("fail",
                      [](const cles::request&) { throw cles::error(cles::errc::failed, "this task always fails"); },
                      {.description = "Always fails", .idempotent = true});
    tasks.on_update("notice", [](const cles::request&) {}, {.description = "Publishes a notice to all subscribers"});
}

} // namespace tool
