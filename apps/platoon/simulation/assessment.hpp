// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "platoon/driver/motion.hpp"

#include <boost/describe/class.hpp>

#include <cmath>
#include <complex>
#include <cstddef>
#include <vector>

namespace platoon {

/// A string ratio up to this one counts as stable. It is above 1 because of the noise that losses add to the errors.
inline constexpr double stable_ratio = 1.02;

/// How much larger the values of each vehicle are than those of the one ahead: of speed and acceleration, [i] is
/// vehicle i+1 divided by vehicle i, of the errors, error[i+1] divided by error[i]. NaN (null) if that of the vehicle
/// is so small that it counts as none.
struct amplification {
    std::vector<double> error{}, speed{}, acceleration{};
};
BOOST_DESCRIBE_STRUCT(amplification, (), (error, speed, acceleration))

/// The larger of both for each vehicle.
void widen(amplification& most, const amplification& one);
/// The largest of all vehicles; NaN: there is none.
double largest(const std::vector<double>& gains_of_each);

/// The result of a drive: `error[i]` is the largest error of the distance between vehicles i and i+1.
struct verdict {
    std::vector<double> error{}; ///< m
    /// The largest of error[i+1]/error[i]: at most 1 if errors do not grow. Errors below 0.1 m, less than a radar can
    /// measure, count as none, and as 0.1 m where a larger one is compared with them.
    double string_ratio = 0;
    /// The largest error divided by error[0]: at most 1 if no error is larger than that behind the leader. Unlike the
    /// errors of neighbours, this may be compared if vehicles differ.
    /// NaN (null) if error[0] is below 0.1 m.
    double first_ratio = NAN;
    /// The largest acceleration of a follower divided by that of the leader; NaN (null) if that is below 0.1 m/s².
    double acceleration_ratio = NAN;
    /// In both halves of the manoeuvre: until the leader accelerates again, and from then on. Of the speed, its largest
    /// change since the half began counts.
    amplification braking{}, recovery{};
    amplification sine{};   ///< of the amplitudes, if the leader's acceleration is a sine; else empty
    double least_gap = NAN; ///< m, from bumper to bumper; NaN (null) if no two were present at the same time
    /// s: the gap divided by the speed at which it closes; NaN (null) if none ever closed
    double least_time_to_collision = NAN;
    bool collision = false;
    bool ended = false;  ///< the manoeuvre; if not, the drive says nothing about string stability
    bool stands = false; ///< in the end, a vehicle stands
    bool apart = false;  ///< in the end, a vehicle is more than 50 m farther from the one ahead than it wants to be
};
BOOST_DESCRIBE_STRUCT(verdict, (),
                      (error, string_ratio, first_ratio, acceleration_ratio, braking, recovery, sine, least_gap,
                       least_time_to_collision, collision, ended, stands, apart))

/// Evaluates the positions of all vehicles at the same times.
class assessment {
  public:
    assessment(std::size_t vehicles, double spacing, double length);

    /// Their positions, the leader first, each at the same desired distance to the one ahead.
    void sample(const std::vector<motion>& where);
    /// The same with a desired distance of each, of which the leader's does not count. If vehicles have joined or left,
    /// only the gaps between those in the lane count.
    /// \param lengths of each; empty: all as given at the start
    void sample(const std::vector<motion>& where, const std::vector<double>& desired,
                const std::vector<double>& lengths = {});
    /// From now on, samples belong to the second half of the manoeuvre.
    void begin_recovery() noexcept { recovering_ = true; }
    /// Measures the amplitudes at the frequency of a sine, of which this is the phase. Whole periods have to be
    /// sampled.
    void correlate(double phase, const std::vector<motion>& where, const std::vector<double>& desired);
    [[nodiscard]] verdict result() const;

  private:
    /// The largest values of each vehicle in a half.
    struct peaks {
        std::vector<double> error{}, speed{}, acceleration{};
        std::vector<double> initial_speed{};

        void add(const std::vector<motion>& where, const std::vector<double>& desired);
        [[nodiscard]] amplification gains_of_each() const;
    };
    /// The sums over the samples, each turned by the phase.
    struct spectrum {
        std::vector<std::complex<double>> error{}, speed{}, acceleration{};
        std::vector<double> initial_speed{}; ///< a constant part would count where samples are not quite whole periods
        std::size_t samples = 0;
    };

    double spacing_, length_;
    verdict result_;
    double of_leader_ = 0, of_others_ = 0; ///< the largest accelerations, m/s²
    bool recovering_ = false;
    peaks braking_{}, recovery_{};
    spectrum sine_{};
};

/// The front of a vehicle, and its length, m.
struct placed {
    double x = 0, length = 0;
};
/// The smallest gap between two successive vehicles, from bumper to bumper; NaN if there are not two.
double least_gap(std::vector<placed> where);

/// The actual distance minus the desired one, of each vehicle but the first.
std::vector<double> spacing_errors(const std::vector<motion>& where, double spacing);

} // namespace platoon
