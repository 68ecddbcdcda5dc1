// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys/bytes.hpp"

#include <array>
#include <cstdint>
#include <span>

namespace cles::security {

/// Where random bytes come from. Tests have one that repeats itself.
class entropy {
  public:
    entropy() = default;
    entropy(const entropy&) = delete;
    entropy& operator=(const entropy&) = delete;
    virtual void fill(std::span<std::uint8_t> out) = 0;

    template <class Integer>
    [[nodiscard]] Integer draw() {
        std::array<std::uint8_t, sizeof(Integer)> bytes{};
        fill(bytes);
        return static_cast<Integer>(load_big<sizeof(Integer)>(bytes.data()));
    }

  protected:
    ~entropy() = default;
};

/// The operating system's generator.
[[nodiscard]] entropy& system_entropy();

} // namespace cles::security
