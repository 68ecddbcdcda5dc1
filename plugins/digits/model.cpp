// SPDX-License-Identifier: BSL-1.0
#include "model.hpp"

#include "fmv/base64.hpp"

#include <bit>
#include <cstddef>
#include <stdexcept>
#include <vector>

namespace digits {

model to_model(const network& n) {
    std::vector<std::uint8_t> bytes;
    bytes.reserve(n.weights.size() * 4);
    for (const auto weight : n.weights) {
        const auto bits = std::bit_cast<std::uint32_t>(weight);
        for (unsigned shift = 0; shift < 32; shift += 8) {
            bytes.push_back(static_cast<std::uint8_t>(bits >> shift));
        }
    }
    return {
        .inputs = n.form.inputs, .hidden = n.form.hidden, .classes = n.form.classes, .weights = fmv::to_base64(bytes)};
}

network from_model(const model& m) {
    network out{.form = {.inputs = m.inputs, .hidden = m.hidden, .classes = m.classes}};
    check(out.form);
    const auto count = out.form.weights();
    const auto bytes = fmv::from_base64(m.weights, count * 4);
    if (!bytes) {
        throw std::invalid_argument("weights: not " + std::to_string(count) + " numbers of 32 bits in base64");
    }
    out.weights.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
        std::uint32_t bits = 0;
        for (std::size_t k = 0; k < 4; ++k) {
            bits |= std::uint32_t{(*bytes)[4 * i + k]} << (8 * k);
        }
        out.weights[i] = std::bit_cast<float>(bits);
    }
    if (!is_finite(out)) {
        throw std::invalid_argument("weights: each is a finite number");
    }
    return out;
}

} // namespace digits
