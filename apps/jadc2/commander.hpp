// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include "picture.hpp"

#include <boost/describe/class.hpp>

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace jadc2 {

/// How orders ended. None is given twice: whether one was carried out that ended as `unknown` is for people to find
/// out.
struct order_fates {
    std::uint64_t given = 0;
    std::uint64_t done = 0;
    std::uint64_t refused = 0; ///< before it began: nobody offers it, nobody has a weapon, no way there
    std::uint64_t failed = 0;  ///< the aircraft said why
    std::uint64_t unknown = 0; ///< the aircraft was lost, or silent, before it answered
    std::uint64_t open = 0;
};
BOOST_DESCRIBE_STRUCT(order_fates, (), (given, done, refused, failed, unknown, open))

/// How an order ends that is answered so: "refused", "failed" or "unknown".
std::string fate_of(const cles::error& why);

/// What the mission centre knows and has decided. It decides; asking and waiting is its caller's.
class commander {
  public:
    /// The newest picture.
    void see(picture what) { latest_ = std::move(what); }
    [[nodiscard]] const picture& latest() const noexcept { return latest_; }

    /// The scripted operator: the oldest target that has been followed for so many frames, is in sight, and against
    /// which nothing has been ordered.
    [[nodiscard]] std::optional<fmv::track> worth_striking(int frames) const;
    /// The target of that number, as the newest picture has it.
    [[nodiscard]] std::optional<fmv::track> find(std::uint64_t id) const;

    /// An order against it is given.
    void ordered(const fmv::track& target);
    /// Its fate; see `order_fates`.
    void ended(const std::string& fate);
    [[nodiscard]] const order_fates& fates() const noexcept { return fates_; }

  private:
    picture latest_;
    std::set<std::pair<std::string, std::uint64_t>> struck_; ///< numbers are of the node that gave them
    order_fates fates_;
};

} // namespace jadc2
