// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>
#include <cles/service.hpp>

#include "output/log_writer.hpp"
#include "platoon/driver/joining.hpp"
#include "platoon/driver/vehicle.hpp"
#include "platoon/driver/vehicle_report.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>

#include <cstdint>
#include <exception>
#include <functional>
#include <set>
#include <string>

namespace platoon {

CLES_DEFAULTS(join_request, (merges))

/// The reply of PULL `clock`.
struct clock_reading {
    double utc = 0;
};
BOOST_DESCRIBE_STRUCT(clock_reading, (), (utc))

struct vehicle_options {
    vehicle_setup setup{};
    bool joins = false;        ///< the platoon that it receives, instead of starting at the position in `setup`
    std::string behind{};      ///< where it joins: behind this vehicle; empty: at the end
    std::int64_t start_ns = 0; ///< the time 0 of the drive, by CLOCK_MONOTONIC
    double seconds = 0;        ///< of the drive; 0: until it is stopped
    cles::multicast_options group{};
    bool insecure = false;  ///< allow a group beyond this host, where nodes are not authenticated
    std::string keys{};     ///< the directory with its key and the roster of its fleet; empty: without security
    std::string exchange{}; ///< a folder with a Unix socket of each vehicle, for true positions; empty: by the group
};

/// A vehicle on the road: the service that connects a `vehicle` with the others. It is bound by multicast to those
/// that it needs, and publishes its own state `hz` times per second.
///
/// Tasks: BIND `state` and `localization`, whose updates are signed if it has a key; PUSH `join` announces a follower,
/// PUSH `leave` makes it leave, PUSH `split` makes it the leader of those behind it.
class vehicle_node {
  public:
    explicit vehicle_node(vehicle_options options);

    /// Drives until it has left, is stopped (SIGTERM, SIGINT), or its time is over.
    /// \throws cles::error `no_target` if there is no platoon to join
    vehicle_report run();

  private:
    boost::asio::awaitable<void> drive();
    boost::asio::awaitable<void> join();
    boost::asio::awaitable<known_vehicles> listen();
    boost::asio::awaitable<void> hear(std::string name);
    boost::asio::awaitable<void> watch(std::string name);
    boost::asio::awaitable<void> ask_clock(std::string name);
    void publish(state_message told);
    void keep(std::set<std::string>& open, const std::string& name,
              boost::asio::awaitable<void> (vehicle_node::*feed)(std::string));
    void end();
    [[nodiscard]] double now() const;

    vehicle_options options_;
    boost::asio::io_context io_{1};
    cles::service service_;
    boost::asio::signal_set signals_;
    vehicle vehicle_;
    std::set<std::string> bound_, watched_; ///< in the group, and for their true positions
    std::set<std::string> reported_;        ///< why updates of some could not be received, each reported once
    std::exception_ptr failure_;
    tool::log_writer log_; ///< it drives on, whatever the reader of its log does
};

/// CLOCK_MONOTONIC, which all processes of a host share.
std::int64_t monotonic_ns();
/// UTC at that time of CLOCK_MONOTONIC, by this host's present time, in s since 1970.
double utc_at(std::int64_t monotonic);
/// The URL of a vehicle's socket for true positions.
std::string exchange_url(const std::string& folder, const std::string& vehicle);

} // namespace platoon
