// SPDX-License-Identifier: BSL-1.0
#include "transport/datagram_io.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>

#include <netinet/in.h>
#include <netinet/udp.h>
#include <sys/socket.h>

namespace cles::transport {

receive_batch::receive_batch() : texts_(std::make_unique_for_overwrite<std::array<text, most>>()) {
    for (std::size_t i = 0; i < most; ++i) {
        places_[i] = {.iov_base = (*texts_)[i].data(), .iov_len = longest};
        headers_[i] = {};
        headers_[i].msg_hdr.msg_name = senders_[i].data();
        headers_[i].msg_hdr.msg_iov = &places_[i];
        headers_[i].msg_hdr.msg_iovlen = 1;
        headers_[i].msg_hdr.msg_control = controls_[i].bytes.data();
    }
}

receive_batch::datagram receive_batch::take() noexcept {
    const std::string_view all{(*texts_)[next_].data(), headers_[next_].msg_len};
    const datagram one{.from = senders_[next_], .text = all.substr(taken_, length_of_each(next_))};
    taken_ += one.text.size();
    if (taken_ == all.size()) {
        ++next_;
        taken_ = 0;
    }
    return one;
}

// All but the last have this length.
std::size_t receive_batch::length_of_each(std::size_t place) noexcept {
    if (const auto* const head = CMSG_FIRSTHDR(&headers_[place].msg_hdr);
        head != nullptr && head->cmsg_level == SOL_UDP && head->cmsg_type == UDP_GRO) {
        int length = 0;
        std::memcpy(&length, CMSG_DATA(head), sizeof length);
        return static_cast<std::size_t>(std::max(length, 1));
    }
    return longest;
}

void receive_batch::prepare(boost::asio::ip::udp::socket& socket) noexcept {
    boost::system::error_code ignored;
    socket.non_blocking(true, ignored);
    socket.set_option(boost::asio::socket_base::receive_buffer_size{1 << 20}, ignored);
    const int on = 1;
    static_cast<void>(::setsockopt(socket.native_handle(), SOL_UDP, UDP_GRO, &on, sizeof on)); // else one at a time
}

bool receive_batch::fetch(boost::asio::ip::udp::socket& socket) noexcept {
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

namespace {

constexpr std::size_t max_runs = 32;
constexpr std::size_t max_in_run = 63;     // UDP_MAX_SEGMENTS is 64; before Linux 5.16, the headers counted as well
constexpr std::size_t max_run = 1U << 15U; // out of the 64 KiB of one datagram

using segment_size = std::uint16_t;

// Datagrams of one length; the last may be shorter.
struct run {
    std::string_view bytes;
    std::size_t count;
    segment_size each;
};

// Removes them from `rest`.
run take_run(core::datagram_list& rest, std::size_t most) noexcept {
    const auto before = rest.bytes();
    const auto length = rest.first().size();
    rest.drop_first();
    std::size_t bytes = length;
    std::size_t count = 1;
    for (bool alike = true; alike && count < most && !rest.empty(); ++count) {
        const auto next = rest.first().size();
        if (next > length || bytes + next > max_run) {
            break;
        }
        rest.drop_first();
        bytes += next;
        alike = next == length;
    }
    return {.bytes = before.substr(0, bytes), .count = count, .each = static_cast<segment_size>(length)};
}

struct segment_control {
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(segment_size))> bytes;
};

void segment(msghdr& message, segment_control& control, segment_size each) noexcept {
    control = {};
    message.msg_control = control.bytes.data();
    message.msg_controllen = control.bytes.size();
    auto* const head = CMSG_FIRSTHDR(&message);
    head->cmsg_level = SOL_UDP;
    head->cmsg_type = UDP_SEGMENT;
    head->cmsg_len = CMSG_LEN(sizeof each);
    std::memcpy(CMSG_DATA(head), &each, sizeof each);
}

} // namespace

send_batch::send_batch(udp::socket& socket) noexcept : socket_(socket) {
    const int not_by_itself = 0;
    segments_ = ::setsockopt(socket.native_handle(), SOL_UDP, UDP_SEGMENT, &not_by_itself, sizeof not_by_itself) == 0;
}

core::datagrams_done send_batch::send(core::datagram_list all, const udp::endpoint* to) noexcept {
    const auto done = segments_ ? send_runs(all, max_in_run, to) : std::nullopt;
    return done ? *done : *send_runs(all, 1, to);
}

core::datagrams_done send_batch::send_all(core::datagram_list all, const udp::endpoint* to) noexcept {
    core::datagrams_done total;
    while (!all.empty()) {
        const auto done = send(all, to);
        if (done.count == 0) {
            break;
        }
        total.count += done.count;
        total.bytes += done.bytes;
        if (done.failed != 0) {
            total.failed += done.failed;
            total.why = done.why;
        }
        for (auto left = done.count; left != 0; --left) {
            all.drop_first();
        }
    }
    return total;
}

std::optional<core::datagrams_done> send_batch::send_runs(core::datagram_list all, std::size_t longest,
                                                          const udp::endpoint* to) noexcept {
    // NOLINTBEGIN(cppcoreguidelines-pro-type-member-init): only the entries in use are set
    std::array<std::size_t, max_runs> in_each;
    std::array<iovec, max_runs> texts;
    std::array<mmsghdr, max_runs> messages;
    std::array<segment_control, max_runs> controls;
    // NOLINTEND(cppcoreguidelines-pro-type-member-init)
    unsigned count = 0;
    for (; !all.empty() && count < max_runs; ++count) {
        const auto now = take_run(all, longest);
        in_each[count] = now.count;
        texts[count] = {.iov_base = const_cast<char*>(now.bytes.data()), .iov_len = now.bytes.size()};
        messages[count] = {};
        messages[count].msg_hdr.msg_iov = &texts[count];
        messages[count].msg_hdr.msg_iovlen = 1;
        if (to != nullptr) {
            messages[count].msg_hdr.msg_name = const_cast<sockaddr*>(to->data());
            messages[count].msg_hdr.msg_namelen = static_cast<socklen_t>(to->size());
        }
        if (now.count > 1) {
            segment(messages[count].msg_hdr, controls[count], now.each);
        }
    }
    const auto try_it = [&] { return ::sendmmsg(socket_.native_handle(), messages.data(), count, MSG_DONTWAIT); };
    auto sent = try_it();
    if (sent < 0 && errno == ECONNREFUSED) { // an error of an earlier datagram: none of these was sent
        sent = try_it();
    }
    if (sent < 0 && errno == EAGAIN) {
        return core::datagrams_done{};
    }
    if (sent < 0 && in_each[0] > 1) { // one by one they may pass, as on a path with a small MTU
        segments_ = errno != EIO;     // the interface cannot segment
        return std::nullopt;
    }
    core::datagrams_done done;
    if (sent < 1) {
        done.failed = in_each[0];
        done.why.assign(errno, boost::system::system_category());
    }
    const auto count_done = static_cast<std::size_t>(std::max(sent, 1)); // the first is sent, or lost
    for (std::size_t i = 0; i < count_done; ++i) {
        done.count += in_each[i];
        done.bytes += texts[i].iov_len;
    }
    return done;
}

} // namespace cles::transport
