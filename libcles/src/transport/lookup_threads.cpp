// SPDX-License-Identifier: BSL-1.0
#include "transport/lookup_threads.hpp"

#include "transport/detached_thread.hpp"
#include "transport/host_lookup.hpp"
#include "transport/ip_host.hpp"
#include "transport/lookup_error.hpp"
#include "transport/member_handler.hpp"

#include <boost/asio/execution/context.hpp>
#include <boost/asio/execution_context.hpp>
#include <boost/asio/query.hpp>
#include <boost/system/errc.hpp>

#include <exception>
#include <new>
#include <utility>
#include <vector>

#include <unistd.h>

namespace cles::transport {
namespace asio = boost::asio;

namespace {

/// Ends what the threads have of a context with that context.
class lookup_service final : public asio::detail::execution_context_service_base<lookup_service> {
  public:
    explicit lookup_service(asio::execution_context& context) : execution_context_service_base(context) {}

    [[nodiscard]] const std::shared_ptr<lookup_threads>& threads() const noexcept { return threads_; }

  private:
    void shutdown() noexcept override { threads_->close(); }
    void notify_fork(asio::execution_context::fork_event event) override {
        switch (event) {
        case asio::execution_context::fork_prepare: return threads_->before_fork();
        case asio::execution_context::fork_parent: return threads_->after_fork(false);
        case asio::execution_context::fork_child: return threads_->after_fork(true);
        }
    }

    std::shared_ptr<lookup_threads> threads_ = std::make_shared<lookup_threads>(start_detached);
};

name_lookups::outcome look_up(const std::string& name) noexcept {
    name_lookups::outcome found;
    try {
        found.found = look_up_now(name, found.code);
    } catch (const std::exception&) { // there is no memory for it
        found.code = boost::system::errc::make_error_code(boost::system::errc::not_enough_memory);
    }
    return found;
}

} // namespace

std::shared_ptr<lookup_threads> lookup_threads::of(const asio::any_io_executor& executor) {
    auto& context = asio::query(executor, asio::execution::context);
    return asio::use_service<lookup_service>(context).threads();
}

lookup_threads::lookup_threads(starter start) : starter_(std::move(start)), process_(::getpid()) {}

lookup_threads::lock lookup_threads::hold() {
    return process_ == ::getpid() ? lock{mutex_} : lock{mutex_, std::defer_lock};
}

void lookup_threads::start(const std::shared_ptr<host_lookup>& by, const asio::any_io_executor& executor,
                           std::string name) {
    const auto held = hold();
    if (!held || closed_) {
        return; // it ends when its time is over
    }
    by->ticket_ = ++last_ticket_;
    waiters_.emplace(last_ticket_, waiter{by, executor});
    const auto asked = names_.ask(name, last_ticket_, time_point::clock::now());
    switch (asked.what) {
    case name_lookups::step::known: return deliver({last_ticket_}, asked.now_known);
    case name_lookups::step::refused: return deliver({last_ticket_}, {.code = lookup_errc::too_many});
    case name_lookups::step::start: return start_thread(name);
    case name_lookups::step::waits: return;
    }
}

// With the lock.
void lookup_threads::start_thread(const std::string& name) {
    bool started = false;
    try {
        started = !starter_([self = shared_from_this(), name] { self->run(name); });
    } catch (const std::bad_alloc&) { // as a thread that is refused
        started = false;
    }
    if (!started) {
        deliver(names_.abort(name), {.code = lookup_errc::no_thread});
    }
}

// On a thread: one name after another, while some wait.
void lookup_threads::run(std::string name) {
    for (std::optional next{std::move(name)}; next;) {
        next = finish(*next, look_up(*next));
    }
}

std::optional<std::string> lookup_threads::finish(const std::string& name, name_lookups::outcome found) {
    const lock held{mutex_};
    if (closed_) {
        return std::nullopt;
    }
    const auto to = names_.finish(name, found, time_point::clock::now());
    deliver(to, found);
    return names_.next();
}

// With the lock: the context lives until `close` has had it.
void lookup_threads::deliver(const std::vector<name_lookups::ticket>& to, const name_lookups::outcome& found) {
    for (const auto ticket : to) {
        const auto which = waiters_.find(ticket);
        if (which == waiters_.end()) {
            continue;
        }
        const auto executor = std::move(which->second.executor);
        auto by = which->second.by.lock();
        waiters_.erase(which);
        if (by) {
            by->outcome_ = found;
            post_call<&host_lookup::on_outcome>(executor, std::move(by));
        }
    }
}

void lookup_threads::forget(const std::string& name, name_lookups::ticket who) {
    if (const auto held = hold()) {
        waiters_.erase(who);
        names_.forget(name, who);
    }
}

void lookup_threads::prefer(std::string_view place, const asio::ip::address& answered) {
    if (const auto held = hold()) {
        names_.prefer(place, answered);
    }
}

std::optional<asio::ip::address> lookup_threads::preferred(std::string_view place) {
    const auto held = hold();
    return held ? names_.preferred(place) : std::nullopt;
}

void lookup_threads::close() {
    const auto held = hold();
    if (held) {
        closed_ = true;
        waiters_.clear(); // the executors end before their context
    }
}

void lookup_threads::before_fork() { mutex_.lock(); }

// The threads are those of the parent only.
void lookup_threads::after_fork(bool is_child) {
    if (is_child) {
        process_ = ::getpid();
        for (const auto& name : names_.running()) {
            start_thread(name);
        }
    }
    mutex_.unlock();
}

} // namespace cles::transport
