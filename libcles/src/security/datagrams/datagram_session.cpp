// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/datagram_session.hpp"

namespace cles::security {

bytes_view datagram_session::seal(std::uint32_t sender, bytes_view line, std::span<std::uint8_t, max_data> to) {
    const auto* const key = agreed_.initiator ? keys_.of_initiator() : keys_.of_responder();
    write_data_head(sender, agreed_.peer_index, next_, to.data());
    noise_seal(key, next_, to.first<data_head_bytes>(), line, to.data() + data_head_bytes);
    ++next_;
    return to.first(data_head_bytes + line.size() + seal_bytes);
}

std::optional<std::size_t> datagram_session::open(const datagram_head& head, bytes_view datagram,
                                                  std::span<std::uint8_t, max_line> to) {
    const auto* const key = agreed_.initiator ? keys_.of_responder() : keys_.of_initiator();
    if (!window_.accepts(head.counter) ||
        !noise_open(key, head.counter, datagram.first(data_head_bytes), datagram.subspan(data_head_bytes), to.data())) {
        return {};
    }
    window_.note(head.counter);
    confirmed_ = true;
    return datagram.size() - data_head_bytes - seal_bytes;
}

} // namespace cles::security
