// SPDX-License-Identifier: BSL-1.0
#include "core/execution.hpp"

#include <cles/json_reader.hpp>

#include "core/handler_failure.hpp"
#include "core/refusals.hpp"

#include <cstdint>
#include <exception>
#include <utility>

namespace cles::core {
namespace {

constexpr std::uint64_t sample_every = 16; // of plain handlers, whose time is measured

} // namespace

execution::execution(node& host, const protocol::request_line& r, const identity& peer, time_point due,
                     std::string& decoded)
    : node_(host), line_(r), handler_(host.tasks.find(r.verb, r.noun.task)),
      parameters_(decode(r.noun, decoded)), data_{.verb = r.verb,
                                                  .node = host.name,
                                                  .task = r.noun.task,
                                                  .parameters = {parameters_.data(), parameters_.size()},
                                                  .body = r.body.empty() ? std::string_view{"{}"} : r.body,
                                                  .peer = &peer,
                                                  .deadline = due},
      request_(data_) {}

std::optional<protocol::failure> execution::refusal(const memory_account* held) {
    if (handler_ == nullptr) {
        return no_such_task(node_, line_);
    }
    if (held != nullptr && !held->has_room(1)) {
        return no_memory(node_);
    }
    if (line_.verb == verb::update && !node_.published.can_publish(publish_path())) {
        return busy(node_.name + ": '" + std::string{line_.noun.task} + "' has as many nouns as it may");
    }
    return is_plain() ? std::nullopt : no_room_to_run(node_);
}

void execution::run(json_writer& w) {
    const bool timed = node_.plain_runs++ % sample_every == 0;
    const auto before = timed ? node_.time.now() : time_point{};
    const auto note_time = [&] {
        if (timed) {
            node_.handler_time.record(node_.time.now() - before);
        }
    };
    try {
        handler_->plain(request_, w);
    } catch (...) {
        note_time();
        throw;
    }
    if (line_.verb == verb::update) {
        std::string body;
        append_compact_json(request_.body(), body);
        node_.published.publish_body(publish_path(), body);
    }
    note_time();
}

call::terms execution::terms() {
    auto wanted = call::terms_of(line_);
    if (line_.verb == verb::update) {
        wanted.publish_path = publish_path();
        append_compact_json(request_.body(), wanted.publish_body);
    }
    return wanted;
}

void execution::start(const std::shared_ptr<call>& c) {
    try {
        handler_->start(request_, c);
    } catch (...) {
        c->fail(describe(std::current_exception()));
    }
}

void publish_for(node& host, const call::terms& wanted) {
    if (!wanted.publish_path.empty()) {
        host.published.publish_body(wanted.publish_path, wanted.publish_body);
    }
}

bool has_begun(const protocol::failure& why) noexcept { return why.code != errc::busy || why.ran; }

} // namespace cles::core
