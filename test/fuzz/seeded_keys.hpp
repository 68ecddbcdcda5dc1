// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/datagrams/entropy.hpp"
#include "security/keys/keys.hpp"

#include <algorithm>
#include <cstdint>
#include <random>
#include <span>
#include <utility>

namespace cles::fuzz {

/// Repeats itself for the same seed.
class seeded_entropy final : public security::entropy {
  public:
    explicit seeded_entropy(std::uint64_t seed) : engine_(seed) {}
    void fill(std::span<std::uint8_t> out) override {
        std::ranges::generate(out, [this] { return static_cast<std::uint8_t>(engine_()); });
    }

  private:
    std::mt19937_64 engine_;
};

inline security::signing_key key_from(std::uint8_t seed) {
    security::secret_bytes whole{32};
    std::ranges::fill(whole.span(), seed);
    return security::signing_key{std::move(whole)};
}

} // namespace cles::fuzz
