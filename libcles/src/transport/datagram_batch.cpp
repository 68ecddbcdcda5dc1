// SPDX-License-Identifier: BSL-1.0
#include "transport/datagram_batch.hpp"

#include <cerrno>

namespace cles::transport {

datagram_batch::datagram_batch() noexcept {
    for (std::size_t i = 0; i < most; ++i) {
        places_[i] = {.iov_base = texts_[i].data(), .iov_len = longest};
        headers_[i] = {};
        headers_[i].msg_hdr.msg_name = senders_[i].data();
        headers_[i].msg_hdr.msg_iov = &places_[i];
        headers_[i].msg_hdr.msg_iovlen = 1;
    }
}

datagram_batch::datagram datagram_batch::take() noexcept {
    const auto i = next_++;
    return {.from = senders_[i], .text = {texts_[i].data(), headers_[i].msg_len}};
}

bool datagram_batch::fetch(boost::asio::ip::udp::socket& socket) noexcept {
    next_ = count_ = 0;
    for (std::size_t i = 0; i < most; ++i) {
        headers_[i].msg_hdr.msg_namelen = static_cast<socklen_t>(senders_[i].capacity());
    }
    const auto got = ::recvmmsg(socket.native_handle(), headers_.data(), most, MSG_DONTWAIT, nullptr);
    if (got < 0) {
        return errno != EAGAIN && errno != EBADF;
    }
    count_ = static_cast<std::size_t>(got);
    for (std::size_t i = 0; i < count_; ++i) {
        senders_[i].resize(headers_[i].msg_hdr.msg_namelen);
    }
    return count_ == most;
}

} // namespace cles::transport
