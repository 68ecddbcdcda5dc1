// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "driver.hpp"
#include "impairment.hpp"
#include "recording.hpp"

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
    bool joins = false;              ///< at the end of the platoon that it receives, instead of where `setup` says
    std::size_t turn = 0, turns = 1; ///< its part of each period, in which it sends
    std::int64_t start_ns = 0;       ///< the time 0 of the drive, by CLOCK_MONOTONIC
    double seconds = 0;              ///< of the drive; 0: until it is told to end
    double loss = 0, delay = 0;
    std::uint64_t seed = 1;
    cles::multicast_options group{};
    bool insecure = false; ///< on a group beyond this host, where nobody proves who he is
};

/// Who wants to join.
struct applicant {
    std::string name{};
};
BOOST_DESCRIBE_STRUCT(applicant, (), (name))

/// A vehicle on the road: a driver, and the service that connects it with the others. It is bound by multicast
/// to the leader and to the one ahead, and tells its own state `hz` times a second.
///
/// Tasks: BIND `state`; PUSH `join` asks it to be followed, PUSH `leave` to leave.
class vehicle_node {
  public:
    explicit vehicle_node(vehicle_options options);

    /// Drives until it has left, is told to end (SIGTERM, SIGINT), or its time is over.
    /// \throws cles::error `no_target` where there is nobody to join
    vehicle_report run();

  private:
    boost::asio::awaitable<void> drive();
    boost::asio::awaitable<void> join();
    boost::asio::awaitable<std::map<std::string, state>> listen();
    boost::asio::awaitable<void> hear(std::string whom);
    void take(const std::string& from, const state& heard, bool timely);
    void be_followed(const applicant& who);
    void begin(const driver_setup& setup);
    void note(double at, const std::string& mode, const std::string& why);
    void tell();
    void end();
    [[nodiscard]] double now() const;

    vehicle_options options_;
    boost::asio::io_context io_{1};
    cles::service service_;
    boost::asio::signal_set signals_;
    impairment radio_;
    std::optional<driver> driver_;
    std::set<std::string> bound_;
    std::set<std::string> unheard_; ///< why some could not be heard, each told once
    std::string follower_;          ///< who has joined behind, at `followed_at_`
    double followed_at_ = 0;
    std::optional<double> left_at_; ///< when it will have left
    std::exception_ptr failure_;
    vehicle_report report_;
};

/// CLOCK_MONOTONIC, which all processes of a machine share.
std::int64_t monotonic_ns();

} // namespace platoon
