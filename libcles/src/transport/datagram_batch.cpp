// SPDX-License-Identifier: BSL-1.0
#include "transport/datagram_batch.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>

#include <netinet/in.h>
#include <netinet/udp.h>

namespace cles::transport {

datagram_batch::datagram_batch() : texts_(std::make_unique_for_overwrite<std::array<text, most>>()) {
    for (std::size_t i = 0; i < most; ++i) {
        places_[i] = {.iov_base = (*texts_)[i].data(), .iov_len = longest};
        headers_[i] = {};
        headers_[i].msg_hdr.msg_name = senders_[i].data();
        headers_[i].msg_hdr.msg_iov = &places_[i];
        headers_[i].msg_hdr.msg_iovlen = 1;
        headers_[i].msg_hdr.msg_control = controls_[i].bytes.data();
    }
}

datagram_batch::datagram datagram_batch::take() noexcept {
    const std::string_view all{(*texts_)[next_].data(), headers_[next_].msg_len};
    const datagram one{.from = senders_[next_], .text = all.substr(taken_, length_of_each(next_))};
    taken_ += one.text.size();
    if (taken_ == all.size()) {
        ++next_;
        taken_ = 0;
    }
    return one;
}

// All but the last have it.
std::size_t datagram_batch::length_of_each(std::size_t place) noexcept {
    if (const auto* const head = CMSG_FIRSTHDR(&headers_[place].msg_hdr);
        head != nullptr && head->cmsg_level == SOL_UDP && head->cmsg_type == UDP_GRO) {
        int length = 0;
        std::memcpy(&length, CMSG_DATA(head), sizeof length);
        return static_cast<std::size_t>(std::max(length, 1));
    }
    return longest;
}

void datagram_batch::keep_together(boost::asio::ip::udp::socket& socket) noexcept {
    const int on = 1;
    static_cast<void>(::setsockopt(socket.native_handle(), SOL_UDP, UDP_GRO, &on, sizeof on)); // else they come alone
}

bool datagram_batch::fetch(boost::asio::ip::udp::socket& socket) noexcept {
    next_ = count_ = 0;
    for (std::size_t i = 0; i < most; ++i) {
        headers_[i].msg_hdr.msg_namelen = static_cast<socklen_t>(senders_[i].capacity());
        headers_[i].msg_hdr.msg_controllen = controls_[i].bytes.size();
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
