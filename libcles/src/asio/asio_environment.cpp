// SPDX-License-Identifier: BSL-1.0
#include "asio/asio_environment.hpp"

#include <cles/error.hpp>
#include <cles/link.hpp>

#include "transport/group_port.hpp"
#include "transport/interface_watch.hpp"
#include "transport/ip_interface.hpp"
#include "transport/member_handler.hpp"
#include "transport/transports.hpp"

#include <boost/asio/execution/context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/query.hpp>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <utility>

#include <sys/timerfd.h>
#include <unistd.h>

namespace cles::asio_port {
namespace asio = boost::asio;

namespace {

/// A task as a function of the executor, which discards it if its execution context is destroyed.
class posted_task {
  public:
    explicit posted_task(std::shared_ptr<core::task> next) noexcept : task_(std::move(next)) {}
    posted_task(posted_task&&) noexcept = default;
    posted_task(const posted_task&) = delete;
    posted_task& operator=(const posted_task&) = delete;
    posted_task& operator=(posted_task&&) = delete;
    ~posted_task() {
        if (task_) {
            task_->discard();
        }
    }

    void operator()() { std::exchange(task_, nullptr)->run(); }

  private:
    std::shared_ptr<core::task> task_;
};

int make_timer() {
    const int made = ::timerfd_create(CLOCK_BOOTTIME, TFD_NONBLOCK | TFD_CLOEXEC);
    if (made < 0) {
        throw error(boost::system::error_code{errno, boost::system::system_category()}, "cannot create a timer");
    }
    return made;
}

} // namespace

boottime_timer::boottime_timer(const asio::any_io_executor& executor, std::function<void()> due)
    : timer_(executor, make_timer()), due_(std::move(due)) {}

void boottime_timer::set(time_point due) {
    // Zero would disarm it.
    const auto at = std::max(due.time_since_epoch(), time_point::duration{1});
    const auto whole = std::chrono::floor<std::chrono::seconds>(at);
    const itimerspec when{.it_interval = {}, .it_value = {.tv_sec = whole.count(), .tv_nsec = (at - whole).count()}};
    ::timerfd_settime(timer_.native_handle(), TFD_TIMER_ABSTIME, &when, nullptr);
    wait();
}

void boottime_timer::stop() {
    due_ = nullptr;
    boost::system::error_code ignored;
    timer_.cancel(ignored);
}

void boottime_timer::wait() {
    if (!due_ || std::exchange(waiting_, true)) {
        return;
    }
    transport::wait_call<&boottime_timer::on_due>(timer_, asio::posix::descriptor_base::wait_read, shared_from_this());
}

void boottime_timer::on_due(boost::system::error_code code) {
    waiting_ = false;
    if (code || !due_) {
        return;
    }
    std::uint64_t times = 0;
    if (::read(timer_.native_handle(), &times, sizeof times) > 0) {
        due_();
    } else { // it was set again while this was pending
        wait();
    }
}

void asio_environment::post(std::shared_ptr<core::task> next) { asio::post(executor_, posted_task{std::move(next)}); }

void asio_environment::start_timer(std::function<void()> due) {
    timer_ = std::make_shared<boottime_timer>(executor_, std::move(due));
}

void asio_environment::set_timer(time_point due) {
    if (timer_) {
        timer_->set(due);
    }
}

void asio_environment::stop_timer() {
    if (timer_) { // null if its creation failed
        timer_->stop();
    }
}

void asio_environment::add_transport(std::string scheme, std::unique_ptr<link_transport> carrier) {
    own_transports_.insert_or_assign(std::move(scheme), std::move(carrier));
}

link_transport* asio_environment::find(std::string_view scheme) const {
    const auto own = own_transports_.find(scheme);
    return own != own_transports_.end() ? own->second.get() : find_transport(scheme);
}

bool asio_environment::has_transport(std::string_view scheme) const { return find(scheme) != nullptr; }

bool asio_environment::is_trusted(const url& where) const {
    const auto* by = find(where.scheme);
    return stays_on_host(where.scheme) || (by != nullptr && by->authenticates());
}

bool asio_environment::is_exposed(const url& where) const {
    const auto* by = find(where.scheme);
    return by != nullptr && by->is_exposed(where);
}

std::unique_ptr<acceptor> asio_environment::listen(const url& where, const limits& bounds) {
    return find(where.scheme)->listen(executor_, where, bounds);
}

std::function<void()> asio_environment::dial(const url& where, std::string_view name, const limits& bounds,
                                             dial_callback done) {
    return find(where.scheme)->dial_node(executor_, where, name, bounds, std::move(done));
}

std::string asio_environment::local_scope() const {
    const auto& context = asio::query(executor_, asio::execution::context);
    return "context/" + std::to_string(reinterpret_cast<std::uintptr_t>(&context));
}

bool asio_environment::is_open(const std::string& name) const { return transport::is_open(name); }

std::vector<core::network_interface> asio_environment::interfaces() { return transport::interfaces_of_host(); }

core::network_interface asio_environment::find_interface(const std::string& name) {
    return transport::find_interface(name);
}

std::shared_ptr<void> asio_environment::watch_interfaces(std::function<void()> on_change) {
    const auto watch = std::make_shared<transport::interface_watch>(executor_, std::move(on_change));
    watch->start();
    // What waits for the system keeps it alive, so its end is not that of the last pointer.
    return {watch.get(), [watch](void*) { watch->stop(); }};
}

std::shared_ptr<core::group_port> asio_environment::join(const core::network_interface& by,
                                                         const multicast_options& where) {
    return std::make_shared<transport::group_port>(executor_, by, where);
}

} // namespace cles::asio_port
