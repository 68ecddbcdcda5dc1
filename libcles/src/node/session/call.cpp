// SPDX-License-Identifier: BSL-1.0
#include "node/session/call.hpp"

#include "node/session/handler_failure.hpp"
#include "node/session/job_table.hpp"
#include "node/session/request_checks.hpp"
#include "node/tracing/span_recorder.hpp"

#include <algorithm>
#include <exception>

namespace cles::core {

call::call(std::shared_ptr<node_state> host, task_sink& owner, terms wanted, std::shared_ptr<memory_account> memory,
           time_point started)
    : node_(std::move(host)), owner_(&owner), terms_(std::move(wanted)), started_(started), held_(std::move(memory)) {
    ++node_->counts.handlers_running;
    node_->counts.routed += terms_.routed ? 1 : 0;
}

call::~call() {
    if (job_ != 0) {
        node_->jobs->remove(job_);
    }
    --node_->counts.handlers_running;
    node_->counts.routed -= terms_.routed ? 1 : 0;
}

std::shared_ptr<call> call::begin(const std::shared_ptr<node_state>& host, task_sink& owner, terms wanted,
                                  const std::shared_ptr<memory_account>& memory, std::size_t text, time_point due,
                                  time_point now) {
    constexpr std::size_t around = 512; // itself and its handler's part, about
    auto c = std::make_shared<call>(host, owner, std::move(wanted), memory, now);
    const auto* const published = c->terms_.to_publish.get();
    if (!c->hold_more(text + (published != nullptr ? published->body.size() : 0) + around)) {
        return nullptr;
    }
    host->deadlines.arm(*c, due);
    return c;
}

void call::done(std::string_view json) {
    if (owner_ == nullptr) {
        return;
    }
    const auto keep = shared_from_this();
    if (terms_.to_publish) {
        try {
            node_->published.publish_body(terms_.to_publish->path, terms_.to_publish->body);
        } catch (...) {
            auto why = after_run(describe(std::current_exception()));
            why.ran = why.ran || why.code == errc::busy; // which promises otherwise that the handler has not run
            end().refuse(*this, why);
            return;
        }
    }
    if (!terms_.grantee.empty() && node_->sharing != nullptr) {
        head_ = node_->sharing->grant_another(terms_.grantee);
    }
    end().answer(*this, json);
}

void call::fail(protocol::failure why) {
    if (owner_ == nullptr) {
        return;
    }
    const auto keep = shared_from_this();
    if (!terms_.routed) {
        why = after_run(std::move(why));
        if (!terms_.grantee.empty()) { // its sender takes any failure that does not say so for a refusal
            why.ran = why.code != errc::busy || why.ran;
        }
        if (!why.ran) {
            terms_.grantee.clear(); // it goes back
        }
    }
    end().refuse(*this, why);
}

void call::abort(protocol::failure why) {
    const auto keep = shared_from_this();
    fail(std::move(why));
    stop();
}

// Called once, since the owner is gone afterwards.
task_sink& call::end() {
    auto& owner = *owner_;
    detach();
    if (!terms_.routed) { // that time is other nodes'
        const auto took = node_->time.now() - started_;
        node_->handler_time.record(took);
        if (job_ != 0) {
            node_->jobs->note_answer(job_, took);
        }
        if (terms_.trace.sampled && !times_recorded_) {
            record_times({}, took);
        }
    }
    return owner;
}

void call::leave_to_others() noexcept {
    terms_.routed = true;
    ++node_->counts.routed;
}

void call::take_back() noexcept {
    terms_.routed = false;
    --node_->counts.routed;
}

bool call::progress(double fraction, std::string_view json) {
    if (owner_ == nullptr) {
        return false;
    }
    reported_ = std::max(reported_, std::clamp(fraction, 0.0, 1.0));
    return terms_.wants_progress && owner_->report(*this, reported_, json);
}

void call::record_times(std::chrono::nanoseconds queued, std::chrono::nanoseconds ran) {
    times_recorded_ = true;
    if (terms_.trace.sampled && node_->spans) {
        node_->spans->add_times(terms_.trace.span, queued, ran);
    }
}

void call::write_log(log_level level, std::string_view text) const {
    const auto trace = terms_.trace ? protocol::trace_id_text(terms_.trace.id) : std::string{};
    node_->write_log(level, {text, owner_ != nullptr ? owner_->peer_address() : std::string_view{}, terms_.id, trace});
}

void call::on_stop(std::function<void()> callback) {
    if (stopped_) {
        callback();
    } else if (owner_ != nullptr) {
        on_stop_ = std::move(callback);
    }
}

void call::detach() noexcept {
    node_->counts.jobs_moved_in += owner_ != nullptr && !terms_.grantee.empty() ? 1 : 0;
    owner_ = nullptr;
    node_->deadlines.disarm(*this);
}

void call::stop() {
    stopped_ = true;
    if (const auto callback = std::exchange(on_stop_, nullptr)) {
        callback();
    }
}

void call::on_deadline(time_point) {
    abort({.code = errc::deadline, .message = node_->name + " did not finish in time"});
}

} // namespace cles::core
