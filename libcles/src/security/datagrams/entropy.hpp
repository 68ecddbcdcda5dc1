// SPDX-License-Identifier: BSL-1.0
#pragma once

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
        Integer value = 0;
        for (const auto byte : bytes) {
            value = static_cast<Integer>(value << 8U | byte);
        }
        return value;
    }

  protected:
    ~entropy() = default;
};

/// The operating system's generator.
[[nodiscard]] entropy& system_entropy();

} // namespace cles::security
