// SPDX-License-Identifier: BSL-1.0
#include "base64.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace fmv {
namespace {

constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr std::uint8_t no_letter = 0xff;

constexpr std::array<std::uint8_t, 256> make_values() {
    std::array<std::uint8_t, 256> values{};
    values.fill(no_letter);
    for (std::size_t i = 0; i < letters.size(); ++i) {
        values[static_cast<unsigned char>(letters[i])] = static_cast<std::uint8_t>(i);
    }
    return values;
}
constexpr auto values = make_values();

} // namespace

std::string to_base64(std::span<const std::uint8_t> bytes) {
    std::string text((bytes.size() + 2) / 3 * 4, '=');
    std::size_t out = 0;
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        const std::size_t some = std::min<std::size_t>(3, bytes.size() - i);
        std::uint32_t bits = std::uint32_t{bytes[i]} << 16U;
        bits |= some > 1 ? std::uint32_t{bytes[i + 1]} << 8U : 0U;
        bits |= some > 2 ? std::uint32_t{bytes[i + 2]} : 0U;
        for (std::size_t k = 0; k <= some; ++k) {
            text[out + k] = letters[(bits >> (18 - 6 * k)) & 63U];
        }
        out += 4;
    }
    return text;
}

std::optional<std::vector<std::uint8_t>> from_base64(std::string_view text, std::size_t size) {
    const std::size_t padding = (3 - size % 3) % 3;
    if (text.size() != (size + 2) / 3 * 4 ||
        text.substr(text.size() - padding) != std::string_view{"=="}.substr(0, padding)) {
        return std::nullopt;
    }
    std::vector<std::uint8_t> bytes(size);
    std::uint8_t seen = 0;
    for (std::size_t i = 0, out = 0; out < size; i += 4, out += 3) {
        std::uint32_t bits = 0;
        const std::size_t some = std::min<std::size_t>(3, size - out);
        for (std::size_t k = 0; k < 4; ++k) {
            const auto value = k <= some ? values[static_cast<unsigned char>(text[i + k])] : std::uint8_t{0};
            seen |= value;
            bits = bits << 6U | (value & 63U);
        }
        for (std::size_t k = 0; k < some; ++k) {
            bytes[out + k] = static_cast<std::uint8_t>(bits >> (16 - 8 * k));
        }
    }
    // Six bits are what a letter has; what is none has all eight.
    return seen < 64 ? std::optional{std::move(bytes)} : std::nullopt;
}

std::size_t base64_size(std::string_view text) noexcept {
    const std::size_t padding = text.ends_with("==") ? 2 : text.ends_with('=') ? 1 : 0;
    return text.size() < 4 ? 0 : text.size() / 4 * 3 - padding;
}

} // namespace fmv
