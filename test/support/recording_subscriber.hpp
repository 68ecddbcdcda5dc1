// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/publish/topic.hpp"

#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <utility>

namespace cles::test {

/// A subscriber that accepts a number of updates that the test sets.
class recording_subscriber final : public core::subscriber {
  public:
    [[nodiscard]] bool takes_updates() const override { return capacity != 0; }
    void put_updates(std::string_view lines) override {
        text_.append(lines);
        --capacity;
        ++puts;
    }
    std::string take() { return std::exchange(text_, {}); }

    /// How many more updates it accepts.
    std::size_t capacity = std::numeric_limits<std::size_t>::max();
    std::size_t puts = 0;

  private:
    std::string text_;
};

} // namespace cles::test
