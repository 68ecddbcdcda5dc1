// SPDX-License-Identifier: BSL-1.0
#include "node/session/task_execution.hpp"

#include <cles/json_reader.hpp>

#include "node/session/handler_failure.hpp"

#include <cstdint>
#include <exception>
#include <utility>

namespace cles::core {
namespace {

constexpr std::uint64_t sample_every = 16; // of plain handlers, whose time is measured

} // namespace

task_execution::task_execution(const std::shared_ptr<node_state>& host, const protocol::request_line& line,
                               const identity& peer, time_point due, time_point now, std::string& decoded)
    : node_(host), line_(line), due_(due), now_(now), handler_(host->tasks.find(line.verb, line.noun.task)),
      parameters_(decode(line.noun, decoded)), data_{.verb = line.verb,
                                                     .node = host->name,
                                                     .task = line.noun.task,
                                                     .parameters = {parameters_.data(), parameters_.size()},
                                                     .body = line.body.empty() ? std::string_view{"{}"} : line.body,
                                                     .peer = &peer,
                                                     .deadline = due},
      request_(data_) {}

void task_execution::run(task_sink& to, const std::shared_ptr<memory_account>& memory) {
    if (const auto why = refusal(memory.get())) {
        to.refuse(*this, *why);
    } else if (handler_->plain) {
        run_plain(to);
    } else {
        start(to, memory);
    }
}

// Why the request cannot start, or nothing.
std::optional<protocol::failure> task_execution::refusal(const memory_account* memory) {
    if (handler_ == nullptr) {
        return no_such_task(*node_, line_);
    }
    if (memory != nullptr && !memory->has_room(1)) {
        return no_memory(*node_);
    }
    if (line_.verb == verb::update && !node_->published.can_publish(publish_path())) {
        return busy(node_->name + ": '" + std::string{line_.noun.task} + "' has as many nouns as it may");
    }
    return handler_->plain ? std::nullopt : no_room_to_run(*node_);
}

void task_execution::run_plain(task_sink& to) {
    std::optional<protocol::failure> why;
    try {
        to.write_result(*this);
        return;
    } catch (...) {
        why = after_run(describe(std::current_exception()));
    }
    to.refuse(*this, *why);
}

void task_execution::write(json_writer& w) {
    auto& node = *node_;
    const bool timed = node.plain_runs++ % sample_every == 0;
    const auto before = timed ? node.time.now() : time_point{};
    const auto note_time = [&] {
        if (timed) {
            node.handler_time.record(node.time.now() - before);
        }
    };
    started_ = true;
    try {
        handler_->plain(request_, w);
    } catch (...) {
        note_time();
        throw;
    }
    if (line_.verb == verb::update) {
        std::string body;
        append_compact_json(request_.body(), body);
        node.published.publish_body(publish_path(), body);
    }
    note_time();
}

void task_execution::start(task_sink& to, const std::shared_ptr<memory_account>& memory) {
    const auto c = call::begin(node_, to, terms(), memory, line_.text.size(), due_, now_);
    if (!c) {
        to.refuse(*this, no_memory(*node_));
        return;
    }
    to.keep(*this, c);
    started_ = true;
    try {
        handler_->start(request_, c);
    } catch (...) {
        c->fail(describe(std::current_exception()));
    }
}

call::terms task_execution::terms() {
    auto wanted = call::terms_of(line_);
    if (line_.verb == verb::update) {
        wanted.publish_path = publish_path();
        append_compact_json(request_.body(), wanted.publish_body);
    }
    return wanted;
}

} // namespace cles::core
