// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/topic.hpp"

#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <utility>

namespace cles::test {

/// A binder that takes updates for as long as a test lets it.
class recording_binder final : public core::binder {
  public:
    [[nodiscard]] bool takes_updates() const override { return room != 0; }
    void put_updates(std::string_view lines) override {
        text_.append(lines);
        --room;
        ++puts;
    }
    std::string take() { return std::exchange(text_, {}); }

    /// How many more times it takes something.
    std::size_t room = std::numeric_limits<std::size_t>::max();
    std::size_t puts = 0;

  private:
    std::string text_;
};

} // namespace cles::test
