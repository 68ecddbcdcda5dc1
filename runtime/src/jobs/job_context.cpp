// SPDX-License-Identifier: BSL-1.0
#include "jobs/job_context.hpp"

#include <cles/registrar.hpp>

#include "jobs/job_record.hpp"

#include <memory>
#include <utility>

namespace cles::runtime {

/// Connects a responder to a job. Results and details of progress come from `to_json`, so that they have been checked.
class job_context::control final : public detail::call_control {
  public:
    explicit control(job_context job) noexcept : job_(std::move(job)) {}

    void done(std::string_view json) override { job_.record_->done(json); }
    void fail(errc code, std::string_view message) override { job_.fail(code, message); }
    void refuse(std::string_view message, std::chrono::milliseconds retry) override { job_.refuse(message, retry); }
    bool progress(double fraction, std::string_view json) override { return job_.record_->progress(fraction, json); }
    void on_stop(std::function<void()> callback) override { job_.on_stop(std::move(callback)); }
    [[nodiscard]] bool stopped() const noexcept override { return job_.stopped(); }
    void delegate(std::string_view command, const call_options& options, answer_callback answered) override {
        job_.delegate(command, options, std::move(answered));
    }
    void log(log_level level, std::string_view text) override { job_.log(level, text); }
    [[nodiscard]] boost::asio::any_io_executor executor() const override { return job_.executor(); }
    [[nodiscard]] bool is_thread_safe() const noexcept override { return true; }

  private:
    job_context job_;
};

namespace {

// \throws cles::error if the text is not JSON
std::string compact(std::string_view json) {
    std::string text;
    json_writer writer{text};
    detail::write_text(writer, json);
    return text;
}

} // namespace

job_context::job_context(const job_context& other) noexcept : record_(other.record_) { record_->add_reference(); }

job_context::~job_context() {
    if (record_ != nullptr) {
        record_->release();
    }
}

const cles::request& job_context::request() const noexcept { return record_->request(); }

bool job_context::stopped() const noexcept { return record_->stopped(); }

void job_context::done(std::string_view json) const {
    std::string result;
    try {
        result = json.empty() ? "" : compact(json);
    } catch (const error& e) {
        fail(errc::failed, e.message());
        return;
    }
    record_->done(result);
}

void job_context::fail(errc code, std::string_view message) const { record_->fail(code, message); }

void job_context::refuse(std::string_view message, std::chrono::milliseconds retry) const {
    record_->refuse(message, retry);
}

// The exception becomes text on this thread, because it belongs to the code that threw it.
void job_context::fail(const std::exception_ptr& thrown) const {
    control call{*this};
    detail::fail_with(call, thrown);
}

bool job_context::progress(double fraction, std::string_view json) const {
    return record_->wants_progress() && record_->progress(fraction, compact(json.empty() ? "{}" : json));
}

void job_context::on_stop(std::function<void()> callback) const { record_->on_stop(std::move(callback)); }

void job_context::delegate(std::string_view command, const call_options& options, answer_callback answered) const {
    record_->delegate(command, options, std::move(answered));
}

void job_context::log(log_level level, std::string_view text) const { record_->log(level, text); }

responder job_context::as_responder() const { return responder{std::make_shared<control>(*this)}; }

std::string& job_context::result_buffer() const { return record_->result_buffer(); }

void job_context::set_result_written() const { record_->set_result_written(); }

boost::asio::any_io_executor job_context::executor() const { return record_->executor(); }

job_work take_work(registration& task) {
    if (task.plain) {
        return [handler = std::move(task.plain)](const job_context& job) {
            job.answer_last([&](json_writer& w) { handler(job.request(), w); });
        };
    }
    return [handler = std::move(task.async)](const job_context& job) { handler(job.request(), job.as_responder()); };
}

} // namespace cles::runtime
