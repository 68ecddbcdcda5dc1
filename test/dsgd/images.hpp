// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "digits/image_set.hpp"
#include "sgd/random_source.hpp"

#include <cstdint>
#include <string>

namespace dsgd_test {

/// Images of nine pixels, of which those of a class's row are bright: easy to learn. Made from a seed, without files.
inline digits::image_set rows_of_pixels(std::size_t count, std::uint64_t seed, std::uint32_t classes = 3) {
    digits::image_set out{{.pixels = 9, .brightest = 100, .classes = 3}};
    sgd::random_source chance{seed};
    for (std::size_t i = 0; i < count; ++i) {
        const auto of_class = chance.below(classes);
        std::string line;
        for (std::uint32_t pixel = 0; pixel < 9; ++pixel) {
            const auto light = chance.below(40) + (pixel / 3 == of_class ? 50 : 0);
            line += std::to_string(light) + ",";
        }
        out.add_line(line + std::to_string(of_class));
    }
    return out;
}

} // namespace dsgd_test
