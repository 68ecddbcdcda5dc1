// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/datagram_format.hpp"

#include "security/keys/bytes.hpp"

#include <algorithm>
#include <string_view>

namespace cles::security {

std::array<std::uint8_t, statement_bytes> write_statement(std::uint64_t index, const node_statement& s) {
    std::array<std::uint8_t, statement_bytes> to{};
    store_big<8>(index, to.data());
    store_big<4>(s.roster, to.data() + 8);
    store_big<4>(s.epoch, to.data() + 12);
    std::ranges::copy(s.salt, to.begin() + 16);
    store_big<8>(s.counter, to.data() + 32);
    return to;
}

node_statement read_statement(std::span<const std::uint8_t, statement_bytes> payload, std::uint64_t& index) {
    index = load_big<8>(payload.data());
    node_statement s{.roster = static_cast<std::uint32_t>(load_big<4>(payload.data() + 8)),
                     .epoch = static_cast<std::uint32_t>(load_big<4>(payload.data() + 12)),
                     .counter = load_big<8>(payload.data() + 32)};
    std::ranges::copy(payload.subspan<16, 16>(), s.salt.begin());
    return s;
}

void write_hello_head(datagram_kind kind, std::uint32_t sender, std::uint64_t index, std::uint8_t* to) {
    to[0] = static_cast<std::uint8_t>(kind);
    store_big<3>(sender, to + 1);
    store_big<8>(index, to + 4);
}

void write_data_head(std::uint32_t sender, std::uint64_t index, std::uint64_t counter, std::uint8_t* to) {
    write_hello_head(datagram_kind::data, sender, index, to);
    store_big<8>(counter, to + 12);
}

void write_group_head(std::uint32_t sender, std::uint32_t generation, const group_salt& salt, std::uint64_t counter,
                      std::uint8_t* to) {
    to[0] = static_cast<std::uint8_t>(datagram_kind::group);
    store_big<3>(sender, to + 1);
    store_big<4>(generation, to + 4);
    std::ranges::copy(salt, to + 8);
    store_big<8>(counter, to + 24);
}

std::array<std::uint8_t, 63> hello_prologue(const public_key& fleet, std::uint32_t responder,
                                            std::span<const std::uint8_t, hello_head_bytes> head) {
    constexpr std::string_view label = "cles datagram 1\n";
    std::array<std::uint8_t, 63> to{};
    auto* at = std::ranges::copy(label, to.data()).out;
    at = std::ranges::copy(fleet, at).out;
    store_big<3>(responder, at);
    std::ranges::copy(head, at + 3);
    return to;
}

datagram_head read_group_head(const std::uint8_t* from) noexcept {
    datagram_head head{.kind = static_cast<datagram_kind>(from[0]),
                       .sender = static_cast<std::uint32_t>(load_big<3>(from + 1)),
                       .generation = static_cast<std::uint32_t>(load_big<4>(from + 4)),
                       .counter = load_big<8>(from + 24)};
    std::copy_n(from + 8, head.salt.size(), head.salt.begin());
    return head;
}

std::optional<datagram_head> read_head(bytes_view datagram) noexcept {
    const auto size = datagram.size();
    if (size < data_head_bytes) {
        return {};
    }
    const auto* const at = datagram.data();
    datagram_head head{.kind = static_cast<datagram_kind>(at[0]),
                       .sender = static_cast<std::uint32_t>(load_big<3>(at + 1))};
    switch (head.kind) {
    case datagram_kind::hello:
    case datagram_kind::welcome:
        if (size != hello_bytes && (head.kind != datagram_kind::hello || size != hello_with_mac_bytes)) {
            return {};
        }
        head.index = load_big<8>(at + 4);
        return head;
    case datagram_kind::data:
        if (size < data_head_bytes + seal_bytes || size > max_data) {
            return {};
        }
        head.index = load_big<8>(at + 4);
        head.counter = load_big<8>(at + 12);
        return head;
    case datagram_kind::group:
        if (size < group_head_bytes + seal_bytes || size > max_sealed) {
            return {};
        }
        return read_group_head(at);
    }
    return {};
}

} // namespace cles::security
