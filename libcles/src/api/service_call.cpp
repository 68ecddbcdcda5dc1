// SPDX-License-Identifier: BSL-1.0
#include "api/service_call.hpp"

#include <cles/reply_operation.hpp>

#include "api/engine.hpp"
#include "node/session/command.hpp"

#include <boost/asio/post.hpp>

#include <algorithm>

namespace cles::api {

service_call::~service_call() {
    if (asked_) {
        call_->forget_on_stop(); // it refers to this object
    }
    if (!call_->ended()) {
        fail(errc::failed, "the handler ended without an answer");
    }
}

void service_call::refuse(std::string_view message, std::chrono::milliseconds retry) {
    constexpr std::chrono::milliseconds::rep most = 86'400'000; // a day, as for plugins
    const auto ms = std::clamp<std::chrono::milliseconds::rep>(retry.count(), 0, most);
    call_->fail({.code = errc::busy, .message = std::string{message}, .retry_ms = static_cast<std::uint64_t>(ms)});
}

void service_call::on_stop(std::function<void()> callback) {
    if (call_->stopped()) {
        callback();
    } else if (asked_) {
        asked_->then = put(std::move(callback));
    } else {
        call_->on_stop(put(std::move(callback)));
    }
}

// Posted: calls are stopped while the library iterates over what a lost link has left.
std::function<void()> service_call::put(std::function<void()> callback) const {
    return [host = call_->host(), callback = std::move(callback)]() mutable {
        host->completions.call(std::move(callback));
    };
}

void service_call::log(log_level level, std::string_view text) {
    if (const auto by = service_.lock()) { // otherwise the log may be gone too
        call_->write_log(level, text);
    }
}

void service_call::delegate(std::string_view command, const call_options& options, answer_callback answered) {
    const auto by = service_.lock();
    const auto refuse = [&](errc why, const char* words) { answer_later(std::move(answered), why, words); };
    if (!by || by->stopped()) {
        refuse(errc::stopped, "the service has been stopped");
    } else if (call_->ended()) {
        refuse(errc::cancelled, "the requesting job has already ended");
    } else if (const auto left = std::chrono::floor<std::chrono::milliseconds>(call_->due() - by->now());
               left.count() <= 0) {
        refuse(errc::deadline, "the requesting job has no time left");
    } else {
        send(*by, command, options, std::move(answered), left);
    }
}

// Not from inside the requesting call: the caller may hold a lock, or may not have recorded its request yet.
void service_call::answer_later(answer_callback answered, errc why, const char* words) {
    boost::asio::post(executor_, [weak = weak_from_this(), answered = std::move(answered), why, words] {
        try {
            answered(why, "{}", words);
        } catch (...) {
            if (const auto self = weak.lock()) {
                detail::fail_with(*self, std::current_exception());
            }
        }
    });
}

void service_call::send(detail::engine& by, std::string_view command, const call_options& options,
                        answer_callback answered, std::chrono::milliseconds left) {
    if (!asked_) {
        asked_ = std::make_unique<asked>();
        follow_stop();
    }
    const auto key = ++asked_->last;
    asked_->tickets.emplace(key, 0);
    const auto why = std::make_shared<std::string>();
    auto completed = [weak = weak_from_this(), key, why, answered = std::move(answered)](boost::system::error_code code,
                                                                                         const json_text& reply) {
        const auto self = weak.lock();
        if (self) {
            self->asked_->tickets.erase(key);
        }
        try {
            answered(code, reply.text, *why);
        } catch (...) {
            if (self) {
                detail::fail_with(*self, std::current_exception());
            }
        }
    };
    auto chosen = options;
    chosen.diagnostics(*why);
    using operation = detail::reply_operation<json_text, false, decltype(completed)>;
    const auto ticket = core::send_command(
        by, command, chosen,
        detail::pending_ptr{detail::make_operation<operation>(std::move(completed), executor_, why.get())}, left);
    if (const auto found = asked_->tickets.find(key); found != asked_->tickets.end()) {
        found->second = ticket;
    }
}

// A call has one stop callback: this object takes it, and then calls the handler's.
void service_call::follow_stop() {
    asked_->then = call_->forget_on_stop();
    call_->on_stop([this] { withdraw_asked(); });
}

void service_call::withdraw_asked() {
    const auto keep = weak_from_this().lock();
    const auto by = service_.lock();
    const auto then = std::exchange(asked_->then, nullptr);
    const auto tickets = std::exchange(asked_->tickets, {});
    const auto withdraw = [&] {
        for (const auto& [key, ticket] : tickets) {
            if (by) {
                by->cancel(ticket);
            }
        }
    };
    // First the job's own: it must know that it was stopped when its requests fail for that reason.
    try {
        if (then) {
            then();
        }
    } catch (...) {
        withdraw();
        throw;
    }
    withdraw();
}

} // namespace cles::api
