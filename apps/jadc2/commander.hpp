// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include "picture.hpp"
#include "strike/order.hpp"

#include <boost/describe/class.hpp>

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace jadc2 {

/// How orders ended. None is given twice: people have to find out whether an `unknown` one was carried out.
struct order_fates {
    std::uint64_t given = 0;
    std::uint64_t done = 0;
    std::uint64_t refused = 0; ///< before it began: no node offers it, has a weapon, or can be reached
    std::uint64_t failed = 0;  ///< the aircraft answered with an error
    std::uint64_t unknown = 0; ///< the aircraft was lost, or silent, before it answered
    std::uint64_t open = 0;
};
BOOST_DESCRIBE_STRUCT(order_fates, (), (given, done, refused, failed, unknown, open))

/// How an order with this error has ended: "refused", "failed" or "unknown".
std::string fate_of(const cles::error& why);

/// The order to strike a track, as it was at that time.
strike::order order_against(const fmv::track& target, double utc, const std::string& id);

/// What the mission centre knows and has decided. It only decides; its caller sends and waits.
class commander {
  public:
    /// The newest picture.
    void set_picture(picture what) { latest_ = std::move(what); }
    [[nodiscard]] const picture& latest() const noexcept { return latest_; }

    /// The scripted operator: the oldest target that has been followed for so many seconds, is in sight, and has no
    /// order yet.
    [[nodiscard]] std::optional<fmv::track> select_target(double seconds) const;
    /// The target with that number in the newest picture.
    [[nodiscard]] std::optional<fmv::track> find(std::uint64_t id) const;

    /// An order against it is given.
    void ordered(const fmv::track& target);
    /// It has ended; see `order_fates`.
    void ended(const std::string& fate);
    [[nodiscard]] const order_fates& fates() const noexcept { return fates_; }

  private:
    picture latest_;
    std::set<std::pair<std::string, std::uint64_t>> struck_; ///< numbers are per node
    order_fates fates_;
};

} // namespace jadc2
