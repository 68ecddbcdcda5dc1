// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "asio/owning_process.hpp"
#include "port/environment.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/system/error_code.hpp>

#include <functional>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::asio_port {

/// A timer on the clock of all deadlines, which continues while the machine is suspended: what became due meanwhile is
/// due as soon as the machine wakes. (Asio's own timers use a clock that stops then, and would be late by the whole
/// suspension.)
class boottime_timer final : public std::enable_shared_from_this<boottime_timer> {
  public:
    /// `due` is called at the time that was set last, or soon after it. \throws cles::error if the system has no timer
    /// to give
    boottime_timer(const boost::asio::any_io_executor& executor, std::function<void()> due);

    void set(time_point due);
    /// `due` is not called any more.
    void stop();

  private:
    void wait();
    void on_due(boost::system::error_code code);

    boost::asio::posix::stream_descriptor timer_;
    std::function<void()> due_; // empty: stopped
    bool waiting_ = false;
};

/// The environment of a node over Boost.Asio: the program's executor, its clock and timer, its own transports, and
/// the registered ones.
class asio_environment final : public core::environment {
  public:
    explicit asio_environment(boost::asio::any_io_executor executor)
        : executor_(std::move(executor)), process_(owning_process::of(executor_)) {}

    [[nodiscard]] const boost::asio::any_io_executor& executor() const noexcept { return executor_; }
    /// The process to which what it has opened belongs.
    [[nodiscard]] const owning_process& process() const noexcept { return *process_; }
    /// Adds a transport of this node only, which has precedence over a registered one: it has the node's keys.
    void add_transport(std::string scheme, std::unique_ptr<link_transport> carrier);

    [[nodiscard]] time_point now() const override { return time_point::clock::now(); }
    std::uint32_t random() override { return random_(); }
    void post(std::shared_ptr<core::task> next) override;

    void start_timer(std::function<void()> due) override;
    void set_timer(time_point due) override;
    void stop_timer() override;

    [[nodiscard]] bool has_transport(std::string_view scheme) const override;
    [[nodiscard]] bool is_trusted(const url& where) const override;
    [[nodiscard]] bool is_exposed(const url& where) const override;
    std::unique_ptr<acceptor> listen(const url& where, const limits& bounds) override;
    std::function<void()> dial(const url& where, std::string_view name, const limits& bounds,
                               dial_callback done) override;

    [[nodiscard]] std::string local_scope() const override;
    [[nodiscard]] bool is_open(const std::string& name) const override;

    std::vector<core::network_interface> interfaces() override;
    core::network_interface find_interface(const std::string& name) override;
    std::shared_ptr<void> watch_interfaces(std::function<void()> on_change) override;
    std::shared_ptr<core::group_port> join(const core::network_interface& by, const multicast_options& where) override;

  private:
    [[nodiscard]] link_transport* find(std::string_view scheme) const;

    boost::asio::any_io_executor executor_;
    std::shared_ptr<const owning_process> process_;
    std::map<std::string, std::unique_ptr<link_transport>, std::less<>> own_transports_;
    std::random_device random_;
    std::shared_ptr<boottime_timer> timer_;
};

} // namespace cles::asio_port
