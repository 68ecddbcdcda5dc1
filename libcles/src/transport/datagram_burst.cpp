// SPDX-License-Identifier: BSL-1.0
#include "transport/datagram_burst.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>

#include <netinet/in.h>
#include <netinet/udp.h>
#include <sys/socket.h>

namespace cles::transport {
namespace {

constexpr std::size_t most_runs = 32;
constexpr std::size_t most_in_run = 63; // UDP_MAX_SEGMENTS is 64, and took the headers for a part of one before 5.16
constexpr std::size_t longest_run = 1U << 15U; // of the 64 KiB of one datagram

using segment_size = std::uint16_t;

// Lines of one length; the last may be shorter.
struct run {
    std::string_view text;
    std::size_t lines;
    segment_size each;
};

std::string_view first_line(std::string_view lines) noexcept { return lines.substr(0, lines.find('\n') + 1); }

run first_run(std::string_view lines, std::size_t most) noexcept {
    const auto length = first_line(lines).size();
    std::size_t bytes = length;
    std::size_t count = 1;
    for (bool alike = true; alike && count < most && bytes < lines.size(); ++count) {
        const auto next = first_line(lines.substr(bytes)).size();
        if (next > length || bytes + next > longest_run) {
            break;
        }
        bytes += next;
        alike = next == length;
    }
    return {.text = lines.substr(0, bytes), .lines = count, .each = static_cast<segment_size>(length)};
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

datagram_burst::datagram_burst(udp::socket& socket) noexcept : socket_(socket) {
    const int not_by_itself = 0;
    segments_ = ::setsockopt(socket.native_handle(), SOL_UDP, UDP_SEGMENT, &not_by_itself, sizeof not_by_itself) == 0;
}

core::lines_done datagram_burst::send(std::string_view lines, const udp::endpoint* to) noexcept {
    if (segments_) {
        if (const auto done = send_runs(lines, most_in_run, to)) {
            return *done;
        }
    }
    return *send_runs(lines, 1, to);
}

std::optional<core::lines_done> datagram_burst::send_runs(std::string_view lines, std::size_t longest,
                                                          const udp::endpoint* to) noexcept {
    // NOLINTBEGIN(cppcoreguidelines-pro-type-member-init): as far as they are used
    std::array<std::size_t, most_runs> in_each;
    std::array<iovec, most_runs> texts;
    std::array<mmsghdr, most_runs> messages;
    std::array<segment_control, most_runs> controls;
    // NOLINTEND(cppcoreguidelines-pro-type-member-init)
    unsigned count = 0;
    for (auto rest = lines; !rest.empty() && count < most_runs; ++count) {
        const auto now = first_run(rest, longest);
        rest.remove_prefix(now.text.size());
        in_each[count] = now.lines;
        texts[count] = {.iov_base = const_cast<char*>(now.text.data()), .iov_len = now.text.size()};
        messages[count] = {};
        messages[count].msg_hdr.msg_iov = &texts[count];
        messages[count].msg_hdr.msg_iovlen = 1;
        if (to != nullptr) {
            messages[count].msg_hdr.msg_name = const_cast<sockaddr*>(to->data());
            messages[count].msg_hdr.msg_namelen = static_cast<socklen_t>(to->size());
        }
        if (now.lines > 1) {
            segment(messages[count].msg_hdr, controls[count], now.each);
        }
    }
    const auto try_it = [&] { return ::sendmmsg(socket_.native_handle(), messages.data(), count, MSG_DONTWAIT); };
    auto sent = try_it();
    if (sent < 0 && errno == ECONNREFUSED) { // an earlier datagram was; of these none has been sent
        sent = try_it();
    }
    if (sent < 0 && errno == EAGAIN) {
        return core::lines_done{};
    }
    if (sent < 0 && in_each[0] > 1) { // each alone might go: the way there may have short frames, for one
        segments_ = errno != EIO;     // that is the interface's
        return std::nullopt;
    }
    core::lines_done done;
    const auto count_done = static_cast<std::size_t>(std::max(sent, 1)); // the first is sent, or lost
    for (std::size_t i = 0; i < count_done; ++i) {
        done.lines += in_each[i];
        done.bytes += texts[i].iov_len;
    }
    return done;
}

} // namespace cles::transport
