// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>

namespace cles::simulation {

/// While it lives, all random bytes of libsodium in this process follow from a seed: keys, salts, indices, challenges.
/// There may be one at a time.
class seeded_sodium {
  public:
    explicit seeded_sodium(std::uint64_t seed);
    seeded_sodium(const seeded_sodium&) = delete;
    seeded_sodium& operator=(const seeded_sodium&) = delete;
    ~seeded_sodium();

    void reseed(std::uint64_t seed) noexcept;
};

} // namespace cles::simulation
