// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "output/log_writer.hpp"
#include "platoon/drive/recording.hpp"
#include "platoon/driver/driver.hpp"
#include "platoon/driver/localization.hpp"
#include "platoon/driver/radar.hpp"
#include "platoon/simulation/impairment.hpp"

#include <boost/asio/awaitable.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>

#include <chrono>
#include <cstdint>
#include <exception>
#include <map>
#include <optional>
#include <set>

namespace platoon {

struct vehicle_options {
    driver_setup setup{};
    bool joins = false;              ///< the platoon that it receives, instead of starting at the position in `setup`
    std::string behind{};            ///< where it joins: behind this vehicle; empty: at the end
    std::size_t turn = 0, turns = 1; ///< the slot of each period in which it sends
    std::int64_t start_ns = 0;       ///< the time 0 of the drive, by CLOCK_MONOTONIC
    double start_utc = 0;            ///< the same in UTC, s since 1970
    double seconds = 0;              ///< of the drive; 0: until it is stopped
    gilbert_elliott losses{};
    double delay = 0;
    std::uint64_t seed = 1;
    cles::multicast_options group{};
    bool insecure = false; ///< allow a group beyond this host, where nodes are not authenticated
    std::string keys{};    ///< the directory with its key and the roster of its fleet; empty: without security
};

/// The body of PUSH `join`.
struct join_request {
    std::string name{};
    bool merges = false; ///< from the next lane, ahead of the present follower
};
BOOST_DESCRIBE_STRUCT(join_request, (), (name, merges))
CLES_DEFAULTS(join_request, (merges))

/// A vehicle on the road: a driver, and the service that connects it with the others. It is bound by multicast
/// to the leader and to the one ahead, and publishes its own state `hz` times per second.
///
/// Tasks: BIND `state`, whose updates are signed if it has a key; PUSH `join` announces a follower, PUSH `leave` makes
/// it leave, PUSH `split` makes it the leader of those behind it.
///
/// Its radar is simulated: the truth is the updates of the one ahead before the simulated losses. If that one's process
/// has ended, its brakes apply by themselves.
class vehicle_node {
  public:
    explicit vehicle_node(vehicle_options options);

    /// Drives until it has left, is stopped (SIGTERM, SIGINT), or its time is over.
    /// \throws cles::error `no_target` if there is no platoon to join
    vehicle_report run();

  private:
    boost::asio::awaitable<void> drive();
    boost::asio::awaitable<void> join();
    boost::asio::awaitable<std::map<std::string, state>> listen();
    boost::asio::awaitable<void> hear(std::string name);
    void receive(const std::string& from, const state& heard, bool timely);
    void measure(double at);
    impairment& link_from(const std::string& name);
    void accept_follower(const join_request& who);
    void begin(const driver_setup& setup);
    void note(double at, const std::string& mode, const std::string& why);
    void publish_state();
    void end();
    [[nodiscard]] double now() const;

    vehicle_options options_;
    boost::asio::io_context io_{1};
    cles::service service_;
    boost::asio::signal_set signals_;
    std::map<std::string, impairment> links_; ///< from each of the others
    radar sensor_;
    std::map<std::string, state> truth_; ///< of each of the others, without simulated losses
    std::string seen_;                   ///< the vehicle ahead in the lane, also if it is not followed any more
    std::optional<driver> driver_;
    std::set<std::string> bound_;
    std::set<std::string> reported_; ///< why updates of some could not be received, each reported once
    std::string follower_;           ///< the vehicle that joined behind, at `followed_at_`
    double followed_at_ = 0;
    std::optional<double> left_at_; ///< when it will have left
    std::exception_ptr failure_;
    tool::log_writer log_; ///< it drives on, whatever the reader of its log does
    vehicle_report report_;
};

/// CLOCK_MONOTONIC, which all processes of a host share.
std::int64_t monotonic_ns();
/// UTC at that time of CLOCK_MONOTONIC, by this host's present time, in s since 1970.
double utc_at(std::int64_t monotonic);

} // namespace platoon
