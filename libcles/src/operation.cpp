// SPDX-License-Identifier: BSL-1.0
// The parts of the operations that do not depend on the type of their handler.
#include <cles/completion.hpp>
#include <cles/feed.hpp>
#include <cles/reply_operation.hpp>

#include <boost/asio/dispatch.hpp>
#include <boost/asio/execution/context.hpp>
#include <boost/asio/execution/outstanding_work.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/prefer.hpp>
#include <boost/asio/query.hpp>
#include <boost/asio/system_executor.hpp>

#include <utility>

namespace cles::detail {
namespace asio = boost::asio;

// --- Handlers on other executors ---

void dispatch_call(const asio::any_io_executor& executor, remote_call_ptr call) {
    asio::dispatch(executor, [call = std::move(call)]() mutable { call.release()->call(); });
}

void post_call(const asio::any_io_executor& executor, remote_call_ptr call) {
    asio::post(executor, [call = std::move(call)]() mutable { call.release()->call(); });
}

std::exception_ptr failure_of(boost::system::error_code code, std::string_view message) {
    return code ? std::make_exception_ptr(error(code, std::string{message})) : std::exception_ptr{};
}

handler_executor::handler_executor(const asio::any_io_executor& own, const asio::any_io_executor& service) {
    if (own != service) {
        namespace execution = asio::execution;
        executor_ = asio::prefer(own, execution::outstanding_work.tracked);
        elsewhere_ = &asio::query(own, execution::context) != &asio::query(asio::system_executor{}, execution::context);
    }
}

void handler_executor::dispatch(remote_call_ptr call) && {
    dispatch_call(std::exchange(executor_, {}), std::move(call));
}

// --- Feeds ---

void next_withdrawal::operator()() const {
    const auto withdraw = [weak = feed, waiting = operation] {
        if (const auto alive = weak.lock()) {
            alive->cancel(waiting);
        }
    };
    if (executor) {
        asio::dispatch(executor, withdraw);
    } else {
        withdraw();
    }
}

void begin_next(const std::shared_ptr<feed_control>& control, event_ptr operation, bool hop) {
    if (!hop) {
        control->next(std::move(operation));
        return;
    }
    // The operation may end on the other thread before this returns, and `control` with it.
    const auto executor = control->executor();
    asio::dispatch(executor,
                   [kept = control, operation = std::move(operation)]() mutable { kept->next(std::move(operation)); });
}

feed_owner::feed_owner(std::shared_ptr<feed_control> control, bool elsewhere)
    : control_(std::move(control)), executor_(control_->executor()), elsewhere_(elsewhere) {}

feed_owner::feed_owner(feed_owner&& other) noexcept
    // NOLINTNEXTLINE(performance-move-constructor-init)
    : control_(std::move(other.control_)), batch_memory_(std::move(other.batch_memory_)), executor_(other.executor_),
      elsewhere_(other.elsewhere_) {}

feed_owner& feed_owner::operator=(feed_owner&& other) noexcept {
    if (this != &other) {
        close();
        control_ = std::move(other.control_);
        batch_memory_ = std::move(other.batch_memory_);
        executor_ = other.executor_;
        elsewhere_ = other.elsewhere_;
    }
    return *this;
}

next_source feed_owner::source() const {
    return {control_, control_ ? asio::any_io_executor{} : executor_, elsewhere_};
}

void feed_owner::close() {
    if (auto control = std::exchange(control_, nullptr)) {
        if (elsewhere_) {
            asio::dispatch(executor_, [control = std::move(control)] { control->close(); });
        } else {
            control->close();
        }
    }
}

// --- Results ---

pending::verdict judge_unread(const json_reader& reader, std::string_view json, boost::system::error_code& code,
                              std::string& why, std::string_view what) {
    if (!is_valid_answer(json)) {
        return pending::verdict::malformed;
    }
    code = errc::conversion;
    why = std::string{what} + " is invalid: " + reader.error();
    return pending::verdict::completed;
}

void judge_thrown(const std::exception& thrown, boost::system::error_code& code, std::string& why,
                  std::string_view what) {
    code = errc::conversion;
    why = std::string{what} + " cannot be read: " + thrown.what();
}

} // namespace cles::detail
