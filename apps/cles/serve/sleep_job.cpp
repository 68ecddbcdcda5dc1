// SPDX-License-Identifier: BSL-1.0
#include "serve/sleep_job.hpp"

#include <boost/describe.hpp>

#include <cstdint>
#include <utility>

namespace tool {
namespace {

struct slept {
    std::int64_t slept_ms = 0;
};
BOOST_DESCRIBE_STRUCT(slept, (), (slept_ms))

constexpr std::int64_t longest = 86'400'000; // a day, as long as any deadline
constexpr int parts = 10;

} // namespace

void sleep_job::start(const cles::request& request, cles::responder answer) {
    if (request.parameters().size() != 1) {
        throw cles::error(cles::errc::bad_request, "sleep takes one parameter, milliseconds, as in sleep/500");
    }
    const auto ms = request.parameter<std::int64_t>(0);
    if (ms < 0 || ms > longest) {
        throw cles::error(cles::errc::bad_request, "parameter 1: 0 to 86400000 milliseconds");
    }
    const auto job = std::make_shared<sleep_job>(std::chrono::milliseconds{ms}, answer);
    // The job owns the responder, which keeps this callback: a weak reference breaks the circle.
    answer.on_stop([weak = std::weak_ptr{job}] {
        if (const auto sleeping = weak.lock()) {
            sleeping->timer_.cancel();
        }
    });
    job->sleep_a_tenth();
}

sleep_job::sleep_job(std::chrono::milliseconds span, cles::responder answer)
    : span_(span), answer_(std::move(answer)), timer_(answer_.get_executor()),
      begun_(std::chrono::steady_clock::now()) {}

void sleep_job::sleep_a_tenth() {
    timer_.expires_at(begun_ + span_ * (tenths_ + 1) / parts);
    timer_.async_wait([self = shared_from_this()](boost::system::error_code code) {
        if (code || self->answer_.stopped()) {
            self->answer_.fail(cles::errc::cancelled, "stopped");
            return;
        }
        if (++self->tenths_ == parts) {
            self->answer_.done(slept{self->span_.count()});
            return;
        }
        self->answer_.progress(static_cast<double>(self->tenths_) / parts);
        self->sleep_a_tenth();
    });
}

} // namespace tool
