// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/registrar.hpp>

#include <boost/describe/class.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace strike {

struct settings {
    std::optional<std::uint64_t> weapons{}; ///< 0 to 1000, 4 unless set
    std::optional<double> lat{}, lon{};     ///< where the aircraft is, in degrees; 800 m west of the traffic unless set
    std::optional<double> height{};         ///< the same, in m above the ground; 600 unless set
    std::optional<double> speed{};          ///< of what it releases, in m/s; 400 unless set
    std::optional<double> oldest_s{};       ///< a track that is older is refused; 2 unless set
    std::optional<double> range_m{};        ///< from the aircraft to the impact, at most; 5000 unless set
    std::optional<double> flight_s{};       ///< of what it releases, at most; 10 unless set
    std::optional<double> widest_m{};       ///< of a target's place by its track, at most; 15 unless set
    std::optional<std::uint64_t> scans{};   ///< of its own sensor, fused with a track; 0 to 30, 30 unless set
    std::optional<std::uint64_t> seed{};    ///< of the traffic that its sensor sees, as of recon; 1 unless set
    std::optional<std::string> ledger{};    ///< the file that keeps what was carried out; none unless set
    std::optional<bool> must_be_signed{};   ///< orders run only with the requester's signature; false unless set
    /// Orders are held until a member other than the requester confirms them; false unless set. Needs security.
    std::optional<bool> must_be_confirmed{};

    /// \throws cles::setting_error
    void check() const;
};
BOOST_DESCRIBE_STRUCT(settings, (),
                      (weapons, lat, lon, height, speed, oldest_s, range_m, flight_s, widest_m, scans, seed, ledger,
                       must_be_signed, must_be_confirmed))

/// A strike aircraft's ability (paper, sections 2.2 and 4.2).
///
/// - DELEGATE strike: see `order`, `outcome` and `decide`. Not idempotent: where the answer is lost it is not repeated.
/// What is released is written to the ledger first, and no order in it is carried out again.
/// An order that another aircraft may carry out is `busy`. It is short enough to run on the I/O thread, without waiting
/// for a worker.
/// - PUSH strike: see `word_on_order`
/// - PULL strike: what is left, and the orders that were carried out or are held
void register_tasks(cles::registrar& to, const settings& wanted);

} // namespace strike
