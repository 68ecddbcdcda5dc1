// SPDX-License-Identifier: BSL-1.0
#include "port/group_port.hpp"

#include <algorithm>
#include <charconv>
#include <system_error>

namespace cles::core {

std::vector<network_interface> automatic(std::vector<network_interface> all) {
    std::erase_if(all, [](const network_interface& each) {
        return !each.running || each.address == 0 || each.point_to_point || !(each.multicast || each.loopback);
    });
    std::stable_partition(all.begin(), all.end(), [](const network_interface& each) { return each.loopback; });
    return all;
}

std::string host_text(const group_source& s) {
    std::string text;
    for (const unsigned shift : {24U, 16U, 8U, 0U}) {
        text.append(text.empty() ? "" : ".").append(std::to_string(s.address >> shift & 0xFFU));
    }
    return text;
}

std::string to_text(const group_source& s) { return host_text(s) + ":" + std::to_string(s.port); }

std::optional<group_source> parse_group_source(std::string_view text) noexcept {
    group_source read;
    for (const char after : {'.', '.', '.', ':', '\0'}) {
        const bool last = after == '\0';
        std::uint32_t number = 0;
        const auto* const end = text.data() + text.size();
        const auto [rest, code] = std::from_chars(text.data(), end, number);
        const bool follows = last ? rest == end : rest != end && *rest == after;
        if (code != std::errc{} || !follows || number > (last ? 0xFFFFU : 0xFFU)) {
            return {};
        }
        if (last) {
            read.port = static_cast<std::uint16_t>(number);
        } else {
            read.address = read.address << 8U | number;
            text.remove_prefix(static_cast<std::size_t>(rest + 1 - text.data()));
        }
    }
    return read.port != 0 ? std::optional{read} : std::nullopt;
}

} // namespace cles::core
