// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace jadc2 {

/// The order that has been read back to an operator, who confirms, holds or aborts it: one at a time. It names a
/// target; where that is, the picture says when the order is confirmed. Times are s since 1970.
class order_desk {
  public:
    /// An order that is neither confirmed nor held lapses after that time, s.
    static constexpr double lapse_s = 30;

    struct proposal {
        std::string by{}; ///< the node that follows the target
        std::uint64_t target = 0;
        bool again = false;
    };

    /// Replaces what was read back before. \return false, and changes nothing, if an order is held
    bool read_back(proposal what, double now);
    /// The order that is confirmed, if there is one.
    std::optional<proposal> confirm(double now);
    /// \return whether there is an order
    bool hold(double now);
    bool abort(double now);

  private:
    [[nodiscard]] bool has_one(double now) const;

    std::optional<proposal> open_;
    double read_utc_ = 0;
    bool held_ = false;
};

} // namespace jadc2
