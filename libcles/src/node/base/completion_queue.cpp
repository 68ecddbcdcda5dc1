// SPDX-License-Identifier: BSL-1.0
#include "node/base/completion_queue.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

void end_with(detail::pending_ptr operation, std::string_view json) {
    auto* const ending = operation.release(); // if its handler throws, it has ended
    if (ending->offer(json) == detail::pending::verdict::malformed) {
        ending->fail(errc::conversion, "the answer is not valid JSON");
    }
}

namespace {

struct caller {
    void operator()(completion::failure& due) const { due.operation.release()->fail(due.code, due.why); }
    void operator()(completion::result& due) const { end_with(std::move(due.operation), due.json); }
    void operator()(completion::event_failure& due) const { due.operation.release()->fail(due.code, due.why); }
    void operator()(completion::event& due) const { due.operation.release()->deliver(due.what.view()); }
    void operator()(const completion::callback& due) const { due.function(); }
    void operator()(const completion::thrown& due) const { std::rethrow_exception(due.what); }
};

} // namespace

void completion::operator()() { std::visit(caller{}, kind_); }

void completion_queue::put(completion due) {
    if (later_) {
        later_(std::move(due));
    } else {
        due();
    }
}

// Usually a line causes one call.
void completion_queue::keep(std::exception_ptr thrown) {
    if (thrown_ == nullptr) {
        thrown_ = std::move(thrown);
    } else {
        put(completion{completion::thrown{std::move(thrown)}});
    }
}

template <class Due>
void completion_queue::complete(Due due) {
    if (due.operation->calls_user()) {
        put(completion{std::move(due)});
    } else {
        caller{}(due);
    }
}

void completion_queue::fail(detail::pending_ptr operation, boost::system::error_code code, std::string_view why,
                            completion::progress_function progress) {
    complete(completion::failure{std::move(operation), code, std::string{why}, std::move(progress)});
}

void completion_queue::refuse(detail::pending_ptr operation, const protocol::failure& why, std::string_view answer,
                              completion::progress_function progress) {
    if (operation->calls_user()) {
        fail(std::move(operation), why.code, why.message, std::move(progress));
    } else {
        operation.release()->refuse(why.code, why.message, answer);
    }
}

void completion_queue::succeed(detail::pending_ptr operation, std::string_view json) {
    complete(completion::result{std::move(operation), std::string{json}});
}

void completion_queue::fail(pending_event_ptr operation, boost::system::error_code code, std::string_view why) {
    complete(completion::event_failure{std::move(operation), code, std::string{why}});
}

void completion_queue::deliver(pending_event_ptr operation, const detail::raw_event& event) {
    if (operation->calls_user()) {
        put(completion{completion::event{std::move(operation), kept_event{event}}});
    } else {
        operation.release()->deliver(event);
    }
}

// -- as tasks of the environment ----------------------------------------------------------------------------------

void completion_drain::put(completion due) {
    due_.push_back(std::move(due));
    post();
}

void completion_drain::post() {
    if (!std::exchange(is_posted_, true)) {
        environment_->post(shared_from_this());
    }
}

void completion_drain::run() {
    is_posted_ = false;
    // At least all that are due now: otherwise a function that puts several each time would outpace the queue.
    for (auto left = std::max(max_at_once, due_.size()); left != 0 && !due_.empty(); --left) {
        auto next = std::move(due_.front());
        due_.pop_front();
        if (!due_.empty()) {
            post();
        }
        next();
    }
}

void completion_drain::discard() noexcept {
    is_posted_ = false; // destructors may put more, which are posted and discarded in turn
    const auto discarded = std::exchange(due_, {});
}

} // namespace cles::core
