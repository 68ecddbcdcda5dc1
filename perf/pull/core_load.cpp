// SPDX-License-Identifier: BSL-1.0
#include "core_load.hpp"

#include <cstddef>
#include <cstdint>

namespace cles::perf {
namespace {

constexpr std::size_t words = std::size_t{4} << 20U; // 32 MiB: more than the caches of a core

[[noreturn]] void burn(const child_process::announce& announce) {
    std::vector<std::uint64_t> memory(words, 1);
    announce("busy");
    std::uint64_t draw = 88172645463325252U; // xorshift64 (Marsaglia 2003, "Xorshift RNGs")
    for (;;) {
        draw ^= draw << 13U;
        draw ^= draw >> 7U;
        draw ^= draw << 17U;
        auto& word = memory[draw % words];
        word = word * draw + 1;
        asm volatile("" : : "r"(&word) : "memory"); // otherwise the compiler would optimise it away
    }
}

} // namespace

core_load::core_load(const std::vector<int>& cores, int processes_per_core) {
    for (const auto core : cores) {
        for (int i = 0; i < processes_per_core; ++i) {
            processes_.push_back(std::make_unique<child_process>(core, burn));
        }
    }
    for (const auto& each : processes_) {
        each->announced();
    }
}

} // namespace cles::perf
