// SPDX-License-Identifier: BSL-1.0
#include "node/session/task_execution.hpp"

#include <cles/json_reader.hpp>

#include "node/security_protocol.hpp"
#include "node/session/call.hpp"
#include "node/session/handler_failure.hpp"
#include "node/session/job_table.hpp"
#include "node/session/request_checks.hpp"
#include "node/sharing/movable_request.hpp"
#include "node/tracing/span_recorder.hpp"

#include <algorithm>
#include <cstdint>
#include <exception>
#include <utility>

namespace cles::core {

// -- the tasks -----------------------------------------------------------------------------------------------------

void check_name(std::string_view name, std::string_view of) {
    if (!protocol::is_name(name)) {
        throw error(errc::invalid_name, protocol::quoted(name) + " is not a " + std::string{of} +
                                            "'s name (1 to 64 letters, digits, '_', '-', '.')");
    }
}

void task_registry::add(cles::verb verb, std::string_view task, handler entry) {
    check_name(task, "task");
    if (task == "cles") {
        throw error(errc::invalid_name, "the task 'cles' is reserved");
    }
    if (find(verb, task) != nullptr) {
        throw error(errc::already_registered, std::string{to_string(verb)} + " '" + std::string{task} + "'");
    }
    if (entry.info.must_be_signed && !is_signed(task)) {
        add_signed(task);
    }
    auto& slot = tasks_[std::string{task}][static_cast<std::size_t>(verb)];
    slot = std::move(entry);
    slot.present = true;
}

std::unique_ptr<handler> task_registry::remove(cles::verb verb, std::string_view task) {
    const auto found = tasks_.find(task);
    if (found == tasks_.end() || find(verb, task) == nullptr) {
        return nullptr;
    }
    auto& all = found->second;
    auto removed = std::make_unique<handler>(std::exchange(all[static_cast<std::size_t>(verb)], handler{}));
    if (std::none_of(all.begin(), all.end(), [](const handler& each) { return each.present; })) {
        tasks_.erase(found);
    }
    return removed;
}

void task_registry::add_signed(std::string_view task) {
    auto bytes = task.size();
    for (const auto& each : signed_) {
        bytes += each.size();
    }
    if (bytes > max_signed_names) {
        throw error(errc::too_large, "the names of signed tasks have more than " + std::to_string(max_signed_names) +
                                         " bytes with '" + std::string{task} + "'");
    }
    signed_.emplace_back(task);
}

bool task_registry::is_signed(std::string_view task) const noexcept {
    return std::find(signed_.begin(), signed_.end(), task) != signed_.end();
}

const handler* task_registry::find(cles::verb verb, std::string_view task) const noexcept {
    const auto found = tasks_.find(task);
    if (found == tasks_.end()) {
        return nullptr;
    }
    const auto& entry = found->second[static_cast<std::size_t>(verb)];
    return entry.present ? &entry : nullptr;
}

bool task_registry::can_bind(std::string_view task) const noexcept {
    return find(verb::bind, task) != nullptr || find(verb::update, task) != nullptr;
}

// -- running one ---------------------------------------------------------------------------------------------------

namespace {

/// Measures the time of every 16th plain handler, and of those of traced requests.
class sampled_time {
  public:
    sampled_time(node_state& host, const protocol::request_line& line) noexcept
        : node_(host), line_(line), span_(line.trace.sampled && host.spans ? line.trace.span : 0),
          runs_(host.plain_runs++ % 16 == 0 || span_ != 0), before_(runs_ ? host.time.now() : time_point{}) {}
    sampled_time(const sampled_time&) = delete;
    sampled_time& operator=(const sampled_time&) = delete;
    ~sampled_time() {
        if (runs_) {
            const auto took = node_.time.now() - before_;
            node_.handler_time.record(took);
            if (node_.jobs) {
                node_.jobs->record(line_.verb, line_.noun.task, took);
            }
            if (span_ != 0) {
                node_.spans->add_times(span_, {}, took);
            }
        }
    }

  private:
    node_state& node_;
    const protocol::request_line& line_;
    std::uint64_t span_; // 0: not traced
    bool runs_;
    time_point before_;
};

} // namespace

decoded_parameters decode(const protocol::noun_view& noun, std::string& storage) {
    decoded_parameters result;
    storage.clear();
    storage.reserve(noun.path.size());
    for (const auto raw : noun.parameters) {
        if (raw.find('%') == std::string_view::npos) {
            result.push_back(raw);
            continue;
        }
        const auto start = storage.size();
        protocol::decode_parameter(raw, storage);
        result.push_back(std::string_view{storage}.substr(start));
    }
    return result;
}

task_execution::task_execution(const std::shared_ptr<node_state>& host, const protocol::request_line& line,
                               const identity& peer, time_point due, time_point now, std::string& decoded)
    : node_(host), line_(line), due_(due), now_(now), handler_(host->tasks.find(line.verb, line.noun.task)),
      parameters_(decode(line.noun, decoded)),
      trace_(line.trace ? protocol::traceparent_text(line.trace) : std::string{}),
      origin_(origin_of(*host, peer, line)), data_{.verb = line.verb,
                                                   .node = host->name,
                                                   .task = line.noun.task,
                                                   .parameters = {parameters_.data(), parameters_.size()},
                                                   .body = line.body.empty() ? std::string_view{"{}"} : line.body,
                                                   .peer = &peer,
                                                   .deadline = due,
                                                   .trace = trace_,
                                                   .requester = origin_.requester,
                                                   .forwarded_by = origin_.forwarder},
      request_(data_) {}

void task_execution::run(task_sink& to, const std::shared_ptr<memory_account>& memory) {
    auto why = refusal(memory.get());
    if (!why && !handler_->plain) {
        start(to, memory);
        return;
    }
    if (!why) {
        try {
            to.write_result(*this);
            node_->counts.jobs_moved_in += granted_ ? 1 : 0;
            return;
        } catch (...) {
            why = after_run(describe(std::current_exception()));
            why->ran = why->ran || (granted_ && why->code != errc::busy);
            node_->counts.jobs_moved_in += granted_ && why->ran ? 1 : 0;
        }
    }
    to.refuse(*this, *why);
}

// Why the request cannot start, or nothing.
std::optional<protocol::failure> task_execution::refusal(const memory_account* memory) {
    if (handler_ == nullptr) {
        return no_such_task(*node_, line_);
    }
    if (auto why = capacity_refusal(memory)) { // first: a challenge and a slot are used once
        return why;
    }
    if (line_.grant != 0 && line_.verb == verb::delegate) {
        if (auto why = grant_refusal()) {
            return why;
        }
    }
    return handler_->info.must_be_signed && line_.verb != verb::bind ? signature_refusal() : std::nullopt;
}

std::optional<protocol::failure> task_execution::capacity_refusal(const memory_account* memory) {
    if (memory != nullptr && !memory->has_capacity(1)) {
        return no_memory(*node_);
    }
    if (line_.verb == verb::update && !node_->published.can_publish(publish_path())) {
        return busy(node_->name + ": '" + std::string{line_.noun.task} + "' has reached its limit of nouns");
    }
    return handler_->plain ? std::nullopt : no_capacity_to_run(*node_);
}

std::optional<protocol::failure> task_execution::grant_refusal() {
    if (node_->sharing == nullptr) {
        return protocol::failure{.code = errc::denied, .message = node_->name + " does not share work"};
    }
    auto why = node_->sharing->use_grant(line_, handler_->info, *data_.peer, now_);
    granted_ = !why;
    return why;
}

std::optional<protocol::failure> task_execution::signature_refusal() {
    if (!node_->secured) {
        return protocol::failure{.code = errc::denied,
                                 .message = node_->name + ": '" + std::string{line_.noun.task} +
                                            "' requires signed requests, and this node has no security"};
    }
    // Not the time of the lines that were read together: an earlier one of them may have taken long.
    auto why = node_->secured->refusal(*data_.peer, line_, due_, node_->time.now());
    data_.deadline = due_;
    return why;
}

void task_execution::write(json_writer& w) {
    const sampled_time during{*node_, line_};
    started_ = true;
    handler_->plain(request_, w);
    if (line_.verb == verb::update) {
        std::string body;
        append_compact_json(request_.body(), body);
        node_->published.publish_body(publish_path(), body);
    }
}

void task_execution::start(task_sink& to, const std::shared_ptr<memory_account>& memory) {
    call::terms wanted{line_};
    if (granted_) {
        wanted.grantee = protocol::last_in_via(line_.via);
    }
    if (line_.verb == verb::update) {
        std::string body;
        append_compact_json(request_.body(), body);
        wanted.to_publish = std::make_unique<const call::publication>(
            call::publication{.path = std::string{publish_path()}, .body = std::move(body)});
    }
    const auto c = call::begin(node_, to, std::move(wanted), memory, line_.text.size(), due_, now_);
    if (!c) {
        to.refuse(*this, no_memory(*node_));
        return;
    }
    if (node_->sharing != nullptr) {
        c->set_movable(node_->sharing->movable(line_, handler_->info, *data_.peer));
    }
    if (node_->jobs) {
        c->list_as(
            node_->jobs->add(*c, line_.noun.task,
                             origin_.requester.empty() ? std::string_view{data_.peer->address} : origin_.requester));
    }
    to.keep(*this, c);
    started_ = true;
    try {
        handler_->start(request_, c);
    } catch (...) {
        c->fail(describe(std::current_exception()));
    }
}

} // namespace cles::core
