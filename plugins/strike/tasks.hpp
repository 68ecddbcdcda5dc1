// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/registrar.hpp>

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>

namespace strike {

struct settings {
    std::optional<std::uint64_t> weapons{}; ///< 0 to 1000, 4 unless set
    std::optional<double> lat{}, lon{};     ///< where the aircraft is, in degrees; 800 m west of the traffic unless set
    std::optional<double> height{};         ///< the same, in m above the ground; 600 unless set
    std::optional<double> speed{};          ///< of what it releases, in m/s; 400 unless set
    std::optional<double> oldest_s{};       ///< a track that is older is refused; 2 unless set
    std::optional<std::uint64_t> scans{};   ///< of its own sensor, fused with a track; 0 to 30, 30 unless set
    std::optional<std::uint64_t> seed{};    ///< of the traffic that its sensor sees, as of recon; 1 unless set
    std::optional<bool> must_be_signed{};   ///< orders run only with the requester's signature; false unless set

    /// \throws cles::setting_error
    void check() const;
};
BOOST_DESCRIBE_STRUCT(settings, (), (weapons, lat, lon, height, speed, oldest_s, scans, seed, must_be_signed))

/// A strike aircraft's ability (paper, sections 2.2 and 4.3).
///
/// - DELEGATE strike: see `order` and `outcome`. Not idempotent: where the answer is lost it is not repeated. It is
/// short enough to run on the I/O thread, without waiting for a worker.
/// - PULL strike: what is left, and the orders that were carried out
void register_tasks(cles::registrar& to, const settings& wanted);

} // namespace strike
