// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/line_link.hpp>
#include <cles/multicast.hpp>
#include <cles/url.hpp>

#include "port/group_port.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

/// The time, if no caller passes it in, as when a handler replies. Tests set it.
class clock {
  public:
    clock() = default;
    clock(const clock&) = delete;
    clock& operator=(const clock&) = delete;
    virtual ~clock() = default;
    [[nodiscard]] virtual time_point now() const = 0;
};

/// A function that an environment calls later.
class task {
  public:
    task() = default;
    task(const task&) = delete;
    task& operator=(const task&) = delete;
    virtual ~task() = default;
    virtual void run() = 0;
    /// It will not run: the environment is being destroyed.
    virtual void discard() noexcept {}
};

/// What a node needs from outside: time, randomness, links, multicast groups. There are two implementations: over
/// Boost.Asio (asio/asio_environment.hpp), and the network of the simulation.
///
/// Everything runs on one thread at a time. No callback is called from inside these functions.
class environment : public clock {
  public:
    /// Uniformly distributed.
    virtual std::uint32_t random() = 0;

    /// Runs a task after the current one; tasks run in the order of the calls. An exception passes to the thread that
    /// runs the environment, and the other tasks still run.
    virtual void post(std::shared_ptr<task> next) = 0;

    /// The only timer: `due` is called at the time that was set last, or soon after it.
    virtual void start_timer(std::function<void()> due) = 0;
    virtual void set_timer(time_point due) = 0;
    /// `due` is not called any more.
    virtual void stop_timer() = 0;

    /// Whether there is a transport for URLs of this scheme.
    [[nodiscard]] virtual bool has_transport(std::string_view scheme) const = 0;
    /// Whether a secured node may use that scheme: its links are authenticated, or do not leave this host.
    [[nodiscard]] virtual bool is_trusted(const url&) const { return false; }
    /// Whether an endpoint there can be reached from other hosts.
    [[nodiscard]] virtual bool is_exposed(const url& where) const = 0;
    /// \throws boost::system::system_error if the address is not available
    virtual std::unique_ptr<acceptor> listen(const url& where, const limits& bounds) = 0;
    /// See `link_transport::dial_node`.
    virtual std::function<void()> dial(const url& where, std::string_view name, const limits& bounds,
                                       dial_callback done) = 0;

    /// The prefix of the `inproc` names at which nodes that share this environment find each other.
    [[nodiscard]] virtual std::string local_scope() const = 0;
    /// Whether a node of this process listens at that `inproc` name.
    [[nodiscard]] virtual bool is_open(const std::string& name) const = 0;

    /// The interfaces of this host. \throws boost::system::system_error if the system does not list them
    virtual std::vector<network_interface> interfaces() = 0;
    /// \throws boost::system::system_error if there is none of that name, or it is down or has no IPv4 address
    virtual network_interface find_interface(const std::string& name) = 0;
    /// Calls `on_change` after the interfaces of this host or their addresses may have changed, until what is returned
    /// is destroyed. Null: they never change. \throws boost::system::system_error if the system does not report it
    virtual std::shared_ptr<void> watch_interfaces(std::function<void()> on_change) {
        static_cast<void>(on_change);
        return nullptr;
    }
    /// Joins a multicast group on an interface. \throws boost::system::system_error
    virtual std::shared_ptr<group_port> join(const network_interface& by, const multicast_options& where) = 0;
};

template <class F>
class function_task final : public task {
  public:
    explicit function_task(F function) : function_(std::move(function)) {}
    void run() override { std::move(function_)(); }

  private:
    F function_;
};

/// Posts a function, which may be move-only.
template <class F>
void post(environment& by, F function) {
    by.post(std::make_shared<function_task<F>>(std::move(function)));
}

} // namespace cles::core
