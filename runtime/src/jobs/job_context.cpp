// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_context.hpp"

#include "jobs/job_control.hpp"
#include "jobs/job_record.hpp"
#include "jobs/pool_state.hpp"

#include <memory>

namespace cles::runtime {

job_context::job_context(const job_context& other) noexcept : record_(other.record_) { record_->add_reference(); }

job_context::~job_context() {
    if (record_ != nullptr) {
        record_->release();
    }
}

const cles::request& job_context::request() const noexcept { return record_->request(); }

bool job_context::stopped() const noexcept { return record_->stopped(); }

void job_context::done(std::string_view json) const { record_->done(json); }

void job_context::fail(errc code, std::string_view message) const { record_->fail(code, message); }

void job_context::refuse(std::string_view message, std::chrono::milliseconds retry) const {
    record_->refuse(message, retry);
}

void job_context::fail(const std::exception_ptr& thrown) const { record_->fail(thrown); }

bool job_context::progress(double fraction, std::string_view json) const { return record_->progress(fraction, json); }

void job_context::on_stop(std::function<void()> callback) const { record_->on_stop(std::move(callback)); }

void job_context::delegate(std::string_view command, const call_options& options, answer_callback answered) const {
    record_->delegate(command, options, std::move(answered));
}

void job_context::log(log_level level, std::string_view text) const { record_->log(level, text); }

responder job_context::as_responder() const { return responder{std::make_shared<job_control>(*this)}; }

std::string& job_context::room_for_result() const { return record_->result_text(); }

void job_context::written() const { record_->set_written(); }

boost::asio::any_io_executor job_context::executor() const { return record_->executor(); }

} // namespace cles::runtime
