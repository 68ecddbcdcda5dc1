// SPDX-License-Identifier: BSL-1.0
#include "core/local_request.hpp"

#include <cles/json_reader.hpp>

#include "core/handler_failure.hpp"
#include "core/refusals.hpp"
#include "core/request_checks.hpp"
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
    const auto* h = node_->tasks.find(r.verb, r.noun.task);
    if (h == nullptr) {
        fail(no_such_task(*node_, r), false);
        return;
    }
    std::string decoded;
    const auto parameters = decode(r.noun, decoded);
    const cles::detail::request_data data{.verb = r.verb,
                                          .node = node_->name,
                                          .task = r.noun.task,
                                          .parameters = {parameters.data(), parameters.size()},
                                          .body = r.body.empty() ? std::string_view{"{}"} : r.body,
                                          .peer = &peer,
                                          .deadline = due};
    if (r.verb == verb::update) {
        std::string scratch;
        publish_path_ = protocol::canonical_path(r.noun, scratch);
        append_compact_json(data.body, publish_body_);
        if (!node_->published.can_publish(publish_path_)) {
            fail({.code = errc::busy,
                  .message = node_->name + ": '" + std::string{r.noun.task} + "' has as many nouns as it may"},
                 false);
            return;
        }
    }
    const cles::request request{data};
    if (h->plain) {
        run_plain(*h, request);
    } else {
        run_later(*h, request, r.wants_progress, now);
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

void local_request::run_plain(const handler& h, const cles::request& request) {
    std::string text;
    try {
        json_writer w{text};
        h.plain(request, w);
    } catch (...) {
        fail(describe(std::current_exception()), true);
        return;
    }
    finish(std::move(text));
}

void local_request::run_later(const handler& h, const cles::request& request, bool wants_progress, time_point now) {
    if (node_->counts.handlers_running >= node_->bounds.running) {
        fail({.code = errc::busy, .message = node_->name + " runs as many handlers as it may"}, false);
        return;
    }
    constexpr std::uint64_t some_id = 1; // there is no progress without one
    const auto c = std::make_shared<call>(
        node_, static_cast<call_owner&>(*this),
        call::terms{.verb = request.verb(), .id = some_id, .wants_progress = wants_progress}, now);
    call_ = c;
    node_->deadlines.arm(*c, request.deadline());
    try {
        h.start(request, c);
    } catch (...) {
        c->fail(describe(std::current_exception()));
    }
}

// -- what the handler says -----------------------------------------------------------------------------------------

void local_request::answer(call& c, std::string_view json) {
    const auto keep = c.shared_from_this();
    c.detach();
    call_.reset();
    finish(std::string{json});
}

void local_request::refuse(call& c, const protocol::failure& why) {
    const auto keep = c.shared_from_this();
    c.detach();
    call_.reset();
    fail(why, why.code != errc::busy || why.ran);
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
    try {
        publish();
    } catch (...) {
        fail(describe(std::current_exception()), true);
        return;
    }
    if (const auto to = std::exchange(to_, nullptr)) {
        to->on_result(which_, json);
    }
}

void local_request::publish() {
    if (!publish_path_.empty()) {
        node_->published.publish_body(publish_path_, publish_body_);
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
