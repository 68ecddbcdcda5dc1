// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/registrar.hpp>

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>

namespace strike {

struct settings {
    std::optional<std::uint64_t> weapons{}; ///< 0 to 1000, 4 unless set
    std::optional<double> x{}, y{};         ///< where the aircraft is, in pixels of the ground; -100, 120 unless set
    std::optional<double> speed{};          ///< of what it releases, in pixels a second; 400 unless set
    std::optional<double> oldest_s{};       ///< a track that is older is refused; 2 unless set
    std::optional<bool> must_be_signed{};   ///< orders run only with the requester's signature; false unless set

    /// \throws cles::setting_error
    void check() const;
};
BOOST_DESCRIBE_STRUCT(settings, (), (weapons, x, y, speed, oldest_s, must_be_signed))

/// A strike aircraft's ability (paper, sections 2.2 and 4.3).
///
/// - DELEGATE strike {"id","x","y","vx","vy","utc","deadline_ms"}: see `order` and `outcome`. Not idempotent: where the
///   answer is lost it is not repeated. It is short enough to run on the I/O thread, without waiting for a worker.
/// - PULL strike: what is left, and the orders that were carried out
void register_tasks(cles::registrar& to, const settings& wanted);

} // namespace strike
