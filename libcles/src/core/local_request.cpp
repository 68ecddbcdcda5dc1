// SPDX-License-Identifier: BSL-1.0
#include "core/local_request.hpp"

#include "core/execution.hpp"
#include "core/handler_failure.hpp"
#include "core/refusals.hpp"
#include "core/result_text.hpp"
#include "protocol/message.hpp"

#include <utility>

namespace cles::core {

local_request::~local_request() { withdraw(); }

void local_request::withdraw() {
    const auto keep = std::exchange(to_, nullptr);
    if (const auto c = std::exchange(call_, nullptr)) {
        c->detach();
        c->stop();
    }
}

void local_request::run(const protocol::request_line& r, const identity& peer, time_point due, time_point now) {
    if (r.noun.task == "cles") { // of which there is only PULL for `any` and `all`
        run_reserved(r);
        return;
    }
    std::string decoded;
    execution task{*node_, r, peer, due, decoded};
    if (auto why = task.refusal()) {
        fail(std::move(*why), false);
    } else if (task.is_plain()) {
        run_plain(task);
    } else {
        run_later(task, due, now);
    }
}

void local_request::run_reserved(const protocol::request_line& r) {
    std::string text;
    json_writer w{text};
    if (r.noun.path == "cles") {
        write_description(w, *node_);
    } else if (r.noun.path == "cles/metrics") {
        write_metrics(w, *node_);
    } else {
        fail(no_such_task(*node_, r), false);
        return;
    }
    finish(std::move(text));
}

void local_request::run_plain(execution& task) {
    std::string text;
    try {
        json_writer w{text};
        task.run(w);
    } catch (...) {
        auto why = describe(std::current_exception());
        const bool begun = has_begun(why);
        fail(std::move(why), begun);
        return;
    }
    finish(std::move(text));
}

void local_request::run_later(execution& task, time_point due, time_point now) {
    constexpr std::uint64_t some_id = 1; // there is no progress without one
    auto wanted = task.terms();
    wanted.id = some_id;
    const auto c = std::make_shared<call>(node_, static_cast<call_owner&>(*this), std::move(wanted), now);
    call_ = c;
    node_->deadlines.arm(*c, due);
    task.start(c);
}

// -- what the handler says -----------------------------------------------------------------------------------------

void local_request::answer(call& c, std::string_view json) {
    const auto keep = let_go(c);
    try {
        publish_for(*node_, c.wanted());
    } catch (...) {
        fail(describe(std::current_exception()), true);
        return;
    }
    finish(std::string{json});
}

void local_request::refuse(call& c, const protocol::failure& why) {
    const auto keep = let_go(c);
    fail(why, has_begun(why));
}

std::shared_ptr<call> local_request::let_go(call& c) {
    auto keep = c.shared_from_this();
    c.detach();
    node_->handler_time.record(node_->time.now() - c.started());
    call_.reset();
    return keep;
}

void local_request::report(call&, double fraction, std::string_view json) {
    if (const auto to = to_) {
        std::string body{json};
        close_result(body, 0);
        to->on_progress(which_, fraction, body);
    }
}

void local_request::finish(std::string json) {
    close_result(json, 0);
    if (protocol::begins_with_error(json)) {
        fail({.code = errc::failed, .message = "the result's first key is 'error'"}, true);
        return;
    }
    if (const auto to = std::exchange(to_, nullptr)) {
        to->on_result(which_, json);
    }
}

void local_request::fail(protocol::failure why, bool begun) {
    if (const auto to = std::exchange(to_, nullptr)) {
        if (!why.message.starts_with(node_->name)) {
            why.message.insert(0, node_->name + ": ");
        }
        to->on_failure(which_, {.told = std::move(why), .begun = begun, .unreachable = false});
    }
}

} // namespace cles::core
