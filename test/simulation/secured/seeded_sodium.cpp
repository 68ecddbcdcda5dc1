// SPDX-License-Identifier: BSL-1.0
#include "simulation/secured/seeded_sodium.hpp"

#include "security/keys/secret.hpp"
#include "simulation/network/dice.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>

#include <sodium.h>

namespace cles::simulation {
namespace {

dice chance{0};

const char* name() { return "simulation"; }
std::uint32_t draw() { return static_cast<std::uint32_t>(chance.next()); }
void fill(void* out, std::size_t size) {
    auto* at = static_cast<std::uint8_t*>(out);
    while (size != 0) {
        const auto value = chance.next();
        const auto count = std::min(size, sizeof value);
        std::memcpy(at, &value, count);
        at += count;
        size -= count;
    }
}

randombytes_implementation seeded{
    .implementation_name = name, .random = draw, .stir = nullptr, .uniform = nullptr, .buf = fill, .close = nullptr};

} // namespace

seeded_sodium::seeded_sodium(std::uint64_t seed) {
    security::prepare_sodium(); // draws some itself, the first time
    chance = dice{seed};
    randombytes_set_implementation(&seeded);
}

seeded_sodium::~seeded_sodium() { randombytes_set_implementation(&randombytes_sysrandom_implementation); }

void seeded_sodium::reseed(std::uint64_t seed) noexcept { chance = dice{seed}; }

} // namespace cles::simulation
