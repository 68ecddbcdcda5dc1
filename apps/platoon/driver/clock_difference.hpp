// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <array>
#include <cstddef>
#include <optional>

namespace platoon {

/// By how much the clock of another vehicle differs, from requests that it answers with its time. The answer was given
/// some time between sending and receiving; half of that is the error at most, so of the last exchanges the fastest
/// counts.
class clock_difference {
  public:
    /// \param sent, received by the local clock, s \param told by that of the other, when it answered
    void add(double sent, double told, double received);
    /// Local time minus the other's; nothing: it has never answered.
    [[nodiscard]] std::optional<double> value() const;
    [[nodiscard]] std::size_t exchanges() const noexcept { return count_; }

  private:
    struct exchange {
        double difference = 0, took = 0;
    };

    std::array<exchange, 8> last_{};
    std::size_t count_ = 0;
};

} // namespace platoon
