// SPDX-License-Identifier: BSL-1.0
#include "node/routing/subrequest.hpp"

#include "node/session/job_table.hpp"
#include "node/session/reply_writer.hpp"
#include "node/session/request_checks.hpp"
#include "node/session/reserved_tasks.hpp"
#include "node/tracing/span_recorder.hpp"

#include <memory>
#include <string>
#include <utility>

namespace cles::core {
namespace {

// Whether the code of an error reply leaves it open that the handler has run.
bool handler_may_have_run(const protocol::failure& why) {
    switch (why.code) {
    case errc::bad_request:
    case errc::denied:
    case errc::no_target:
    case errc::no_task:
    case errc::busy: return why.ran;
    default: return true;
    }
}

// A failure to reach the node, or to receive its reply.
subrequest_failure transit_failure(boost::system::error_code code, std::string_view message) {
    subrequest_failure why{.reported = {.code = errc::unavailable, .message = std::string{message}}};
    // `busy` is from this node itself, which holds too much already.
    for (const auto reported : {errc::deadline, errc::cancelled, errc::too_large, errc::busy, errc::no_target}) {
        if (code == reported) {
            why.reported.code = reported;
        }
    }
    why.may_have_started =
        code == errc::unavailable || code == errc::stopped || code == errc::deadline || code == errc::cancelled;
    why.unreachable = !why.may_have_started && code != errc::too_large && code != errc::busy;
    return why;
}

} // namespace

// -- at another node -----------------------------------------------------------------------------------------------

subrequest::verdict subrequest::offer(std::string_view json) {
    if (!detail::is_valid_answer(json)) {
        return verdict::malformed;
    }
    end(json, nullptr);
    return verdict::completed;
}

void subrequest::fail(boost::system::error_code code, std::string_view message) {
    auto why = transit_failure(code, message);
    end({}, &why);
}

void subrequest::refuse(boost::system::error_code, std::string_view, std::string_view answer) {
    subrequest_failure why;
    protocol::parse_failure(answer, why.reported);
    why.reported.answer = answer;
    why.may_have_started = handler_may_have_run(why.reported);
    end({}, &why);
}

void subrequest::end(std::string_view json, subrequest_failure* why) {
    const std::unique_ptr<subrequest> self{this};
    then_(json, why);
}

outbound::progress_function progress_to(const std::shared_ptr<call>& c) {
    if (!c->wanted().wants_progress || c->wanted().id == 0) {
        return {};
    }
    return [c](double fraction, std::string_view json) { c->progress(fraction, json); };
}

protocol::failure named(subrequest_failure why, std::string_view node) {
    if (why.reported.answer.empty() && !why.reported.message.starts_with(node)) {
        why.reported.message.insert(0, std::string{node} + ": ");
    }
    return std::move(why.reported);
}

// -- at this node --------------------------------------------------------------------------------------------------

local_request::~local_request() { withdraw(); }

void local_request::withdraw() {
    const auto keep = std::exchange(then_, nullptr);
    if (const auto c = std::exchange(call_, nullptr)) {
        c->detach();
        c->stop();
    }
}

void local_request::run(const protocol::request_line& r, const identity& peer, time_point due, time_point now) {
    if (r.noun.task != "cles") {
        std::string decoded;
        task_execution{node_, r, peer, due, now, decoded}.run(*this, memory_);
        return;
    }
    std::string text; // only PULL, for `any` and `all`
    json_writer w{text};
    if (r.noun.path == "cles") {
        write_description(w, *node_);
    } else if (r.noun.path == "cles/metrics") {
        write_metrics(w, *node_);
    } else if (r.noun.path == "cles/jobs" && node_->jobs) {
        node_->jobs->write(w, *node_, node_->bounds.line / 2); // the other half is for those of other nodes
    } else if (const auto id = protocol::parse_trace_id(is_spans_request(r) ? r.noun.parameters[1] : "");
               id && node_->spans) {
        node_->spans->write(w, *id, now);
    } else {
        fail(no_such_task(*node_, r), false);
        return;
    }
    finish(std::move(text));
}

void local_request::write_result(task_execution& task) {
    std::string text;
    json_writer w{text};
    task.write(w);
    finish(std::move(text));
}

void local_request::refuse(const task_execution& task, const protocol::failure& why) {
    fail(why, task.started() && may_have_started(why));
}

void local_request::keep(const task_execution&, const std::shared_ptr<call>& c) { call_ = c; }

void local_request::answer(const call&, std::string_view json) {
    call_.reset();
    finish(std::string{json});
}

void local_request::refuse(const call&, const protocol::failure& why) {
    call_.reset();
    fail(why, may_have_started(why));
}

bool local_request::report(const call&, double fraction, std::string_view json) {
    if (progress_) {
        std::string body{json};
        close_body(body, 0);
        progress_(fraction, body);
    }
    return true;
}

void local_request::finish(std::string json) {
    if (auto why = close_result(json, 0)) {
        fail(std::move(*why), true);
    } else if (const auto then = std::exchange(then_, nullptr)) {
        then(json, nullptr);
    }
}

void local_request::fail(protocol::failure why, bool begun) {
    if (const auto then = std::exchange(then_, nullptr)) {
        if (!why.message.starts_with(node_->name)) {
            why.message.insert(0, node_->name + ": ");
        }
        subrequest_failure failure{.reported = std::move(why), .may_have_started = begun};
        then({}, &failure);
    }
}

} // namespace cles::core
