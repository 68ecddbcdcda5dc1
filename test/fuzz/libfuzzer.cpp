// SPDX-License-Identifier: BSL-1.0
// The entry point of libFuzzer for generated inputs.
#include "fuzz/fuzz.hpp"

#include <cstddef>
#include <cstdint>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    cles::fuzz::run({reinterpret_cast<const char*>(data), size});
    return 0;
}
