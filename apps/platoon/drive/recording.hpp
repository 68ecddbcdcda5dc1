// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/motion.hpp"
#include "platoon/driver/vehicle_report.hpp"
#include "platoon/simulation/assessment.hpp"

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace platoon {

/// One vehicle over the time of a drive; null (NaN) while it is not on the lane.
struct course {
    std::string vehicle{};
    std::vector<double> speed{}, acceleration{}; ///< m/s, m/s²
    std::vector<double> error{};                 ///< m, of the distance to the one ahead (the leader has none)
    std::vector<double> distance{};              ///< to the one ahead in the lane, front to front, m
    std::vector<double> place{};                 ///< along the road, m
    std::vector<double> lat{}, lon{};            ///< degrees
    std::vector<std::string> mode{};             ///< empty while it is not on the lane
};
BOOST_DESCRIBE_STRUCT(course, (), (vehicle, speed, acceleration, error, distance, place, lat, lon, mode))

/// Adds a moment to it; all are NaN where the vehicle is not there. \param spacing the desired distance
void extend(course& of, const motion& where, double distance, double spacing, const std::string& mode);

/// The latencies of updates, in microseconds.
struct latency_summary {
    std::uint64_t count = 0;
    double p50_us = 0, p99_us = 0, p999_us = 0, max_us = 0;
    std::uint64_t late = 0;      ///< more than the 100 ms that platooning allows
    std::vector<double> curve{}; ///< the quantiles 0, 0.001 ... 1
};
BOOST_DESCRIBE_STRUCT(latency_summary, (), (count, p50_us, p99_us, p999_us, max_us, late, curve))

latency_summary summarise(std::vector<double> latencies_us);

/// The complete record of a drive, simulated or not.
struct recording {
    std::string source{}; ///< "control law", "driven" or "watched"
    std::size_t vehicles = 0;
    double hz = 0, loss = 0, burst = 0, delay_ms = 0, spacing = 0; ///< burst: updates, on average; 0: independent
    std::uint64_t seed = 0;
    bool steady =
        true; ///< no vehicle joined, left or vanished, so that `verdict.error` and `string_ratio` are meaningful
    struct verdict verdict {};
    std::uint64_t fallbacks = 0;          ///< how often a vehicle fell back because updates were missing
    std::uint64_t radar_spells = 0;       ///< how often one followed by its radar alone because updates were missing
    std::uint64_t sent = 0, received = 0; ///< updates, by vehicles that were bound
    std::uint64_t missed = 0;             ///< updates that nodes reported as gaps
    std::uint64_t relayed = 0, lost = 0;  ///< packets that the relay delivered, and that it lost
    std::uint64_t overflown = 0;          ///< and those that the device of their vehicle did not take
    latency_summary latency{};
    std::vector<event> events{};
    std::vector<double> t{};
    std::vector<course> courses{};
};
BOOST_DESCRIBE_STRUCT(recording, (),
                      (source, vehicles, hz, loss, burst, delay_ms, spacing, seed, steady, verdict, fallbacks,
                       radar_spells, sent, received, missed, relayed, lost, overflown, latency, events, t, courses))

/// A few lines of text.
std::string summary_of(const recording& drive);
/// Checks that a file can be opened for writing; it is created if it does not exist, and not changed otherwise.
/// \throws cles::error if it cannot
void check_writable(const std::string& path);
/// \throws cles::error if the file cannot be written
void write(const recording& drive, const std::string& path);

} // namespace platoon
