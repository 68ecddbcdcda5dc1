// SPDX-License-Identifier: BSL-1.0
#include "node/routing/local_request.hpp"

#include "node/session/call.hpp"
#include "node/session/reply_writer.hpp"
#include "node/session/request_checks.hpp"
#include "node/session/reserved_tasks.hpp"
#include "protocol/datagram.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

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
    if (r.noun.task == "cles") { // only PULL, for `any` and `all`
        run_reserved(r);
        return;
    }
    std::string decoded;
    task_execution{node_, r, peer, due, now, decoded}.run(*this, memory_);
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

// -- outcomes ------------------------------------------------------------------------------------------------------

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
    if (const auto to = to_) {
        std::string body{json};
        close_body(body, 0);
        to->on_progress(which_, fraction, body);
    }
    return true;
}

void local_request::finish(std::string json) {
    if (auto why = close_result(json, 0)) {
        fail(std::move(*why), true);
    } else if (const auto to = std::exchange(to_, nullptr)) {
        to->on_result(which_, json);
    }
}

void local_request::fail(protocol::failure why, bool begun) {
    if (const auto to = std::exchange(to_, nullptr)) {
        if (!why.message.starts_with(node_->name)) {
            why.message.insert(0, node_->name + ": ");
        }
        to->on_failure(which_, {.told = std::move(why), .may_have_started = begun, .unreachable = false});
    }
}

} // namespace cles::core
