// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/environment.hpp"

#include <boost/asio/any_io_executor.hpp>

#include <functional>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace cles::asio_port {

/// The environment of a node over Boost.Asio: the program's executor, its clock and timer, and the registered
/// transports.
class asio_environment final : public core::environment {
  public:
    explicit asio_environment(boost::asio::any_io_executor executor) : executor_(std::move(executor)) {}
    ~asio_environment() override;

    [[nodiscard]] const boost::asio::any_io_executor& executor() const noexcept { return executor_; }

    [[nodiscard]] time_point now() const override { return time_point::clock::now(); }
    std::uint32_t random() override { return random_(); }
    void post(std::shared_ptr<core::task> next) override;

    void start_timer(std::function<void()> due) override;
    void set_timer(time_point due) override;
    void stop_timer() override;

    [[nodiscard]] bool has_transport(std::string_view scheme) const override;
    [[nodiscard]] bool is_exposed(const url& where) const override;
    std::unique_ptr<acceptor> listen(const url& where, const limits& bounds) override;
    std::function<void()> dial(const url& where, const limits& bounds, dial_callback done) override;

    [[nodiscard]] std::string local_scope() const override;
    [[nodiscard]] bool is_open(const std::string& name) const override;

    std::vector<core::network_interface> interfaces() override;
    core::network_interface find_interface(const std::string& name) override;
    std::shared_ptr<core::group_port> join(const core::network_interface& by, const multicast_options& where) override;

  private:
    class timer;

    boost::asio::any_io_executor executor_;
    std::random_device random_;
    std::shared_ptr<timer> timer_;
};

} // namespace cles::asio_port
