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
    std::uint64_t done = 0;    ///< a weapon was released
    std::uint64_t hit = 0;     ///< of these
    std::uint64_t missed = 0;  ///< of these
    std::uint64_t unseen = 0;  ///< of these: nobody has told what happened
    std::uint64_t refused = 0; ///< before it began: no node offers it, has a weapon, or can be reached
    std::uint64_t failed = 0;  ///< the aircraft answered with an error
    std::uint64_t aborted = 0; ///< withdrawn before a release
    std::uint64_t unknown = 0; ///< the aircraft was lost, or silent, before it answered
    std::uint64_t open = 0;
};
BOOST_DESCRIBE_STRUCT(order_fates, (), (given, done, hit, missed, unseen, refused, failed, aborted, unknown, open))

/// "2 orders: 1 released (1 hit, 0 missed, 0 not seen), 1 refused, ..."
std::string text_of(const order_fates& all);

/// The exit code of a mission centre: 0 if there were orders, and each has hit; 4 if it is not known what became of
/// one; 5 if one failed, 7 if one has missed, 3 if one was refused or aborted, or none was given: the first of these.
int exit_code_of(const order_fates& all);

/// How an order with this error has ended: "refused", "failed" or "unknown".
std::string fate_of(const cles::error& why);

/// Whether the node with this error was not reached, so that it has not begun.
bool could_not_be_reached(const cles::error& why);

/// The order to strike a track, as it was at that time.
strike::order order_against(const fmv::track& target, double utc, const std::string& id);

/// What the mission centre knows and has decided. It only decides; its caller sends and waits.
class commander {
  public:
    /// The newest picture.
    void set_picture(picture what) { latest_ = std::move(what); }
    [[nodiscard]] const picture& latest() const noexcept { return latest_; }

    /// The script: the oldest target that has been followed for so many seconds, is in sight, and has not been
    /// attacked.
    [[nodiscard]] std::optional<fmv::track> select_target(double seconds) const;
    /// The target with that number in the newest picture.
    [[nodiscard]] std::optional<fmv::track> find(std::uint64_t id) const;

    /// Whether an order against it has been given here, or the picture says that it is under attack or hit.
    [[nodiscard]] bool is_attacked(const fmv::track& target) const;

    /// Why no order is given against a target of the newest picture; empty if one may be.
    /// \param again whether it may be attacked again \param now s since 1970 \param oldest_s of a picture
    [[nodiscard]] std::string objection(const fmv::track& target, bool again, double now, double oldest_s) const;

    /// An order against it is given.
    void ordered(const fmv::track& target);
    /// It has ended; see `order_fates`.
    void ended(const std::string& fate);
    /// What is known of an impact: whether it has hit.
    void assessed(std::optional<bool> hit);
    [[nodiscard]] const order_fates& fates() const noexcept { return fates_; }

  private:
    picture latest_;
    std::set<std::pair<std::string, std::uint64_t>> struck_; ///< numbers are per node
    order_fates fates_;
};

} // namespace jadc2
