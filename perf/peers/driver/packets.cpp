// SPDX-License-Identifier: BSL-1.0
#include "packets.hpp"

#include <algorithm>
#include <bit>
#include <stdexcept>

#include <endian.h>

namespace cles::perf::peers {
namespace {

icd::request_bytes short_packet(std::uint16_t type) noexcept {
    return std::bit_cast<icd::request_bytes>(icd::request_packet{htobe16(type), htobe16(sizeof(icd::request_packet))});
}

bool is_packet(std::span<const std::byte> bytes, const icd::request_bytes& expected) {
    return std::equal(bytes.begin(), bytes.end(), expected.begin(), expected.end());
}

} // namespace

icd::request_bytes request_of(call what) noexcept {
    return what == call::exchange ? icd::pack_request() : short_packet(task_type);
}

std::span<const std::byte> answering::answer(std::span<const std::byte> request) {
    if (is_packet(request, request_of(call::exchange))) {
        localization_ = icd::pack_reply(sample(served_++));
        return localization_;
    }
    if (is_packet(request, request_of(call::task))) {
        done_ = short_packet(done_type);
        return done_;
    }
    throw std::runtime_error("the message is not a request");
}

void check_answer(call what, std::span<const std::byte> answer) {
    if (what == call::task) {
        if (!is_packet(answer, short_packet(done_type))) {
            throw std::runtime_error("the message is not the answer to the task");
        }
        return;
    }
    icd::reply_bytes bytes{};
    if (answer.size() != bytes.size()) {
        throw std::runtime_error("the message is not a localization");
    }
    std::copy(answer.begin(), answer.end(), bytes.begin());
    const auto value = icd::unpack_reply(bytes);
    if (!value || !is_sample(*value)) {
        throw std::runtime_error("the received values are not those that were sent");
    }
}

publication read_update(std::span<const std::byte> packet) {
    if (packet.size() != sizeof(icd::update_packet)) {
        throw std::runtime_error("the message is not an update");
    }
    const auto update = icd::unpack_update(packet);
    if (!update) {
        throw std::runtime_error("the message is not an update");
    }
    return update->value;
}

} // namespace cles::perf::peers
