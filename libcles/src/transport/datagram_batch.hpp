// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/ip/udp.hpp>
#include <boost/system/error_code.hpp>

#include <array>
#include <cstddef>
#include <memory>
#include <string_view>

#include <sys/socket.h>

namespace cles::transport {

/// Datagrams that one system call has fetched, each with where it came from, to be taken one by one. What has not been
/// taken when its taker throws is still there.
///
/// Those of one sender that the system keeps together (UDP_GRO, udp(7)) fill one place. A place has room for as many as
/// there may be; of that, memory is used as far as something came there, unless the program locks all it has.
class datagram_batch {
  public:
    using endpoint = boost::asio::ip::udp::endpoint;
    static constexpr std::size_t most = 4; ///< places

    datagram_batch();
    datagram_batch(const datagram_batch&) = delete;
    datagram_batch& operator=(const datagram_batch&) = delete;

    struct datagram {
        const endpoint& from;
        std::string_view text; ///< both valid until the next `fetch`
    };
    [[nodiscard]] bool empty() const noexcept { return next_ == count_; }
    /// \pre not empty
    datagram take() noexcept;

    /// Has the system keep together what came to this socket together, where it can.
    static void keep_together(boost::asio::ip::udp::socket& socket) noexcept;

    /// Fetches and hands over to `each` what is there, as much as one turn may; what `each` throws passes through. Ends
    /// where the socket is closed meanwhile. \return whether some are left for the next turn: no need to wait for more
    template <class F>
    [[nodiscard]] bool hand_over(boost::asio::ip::udp::socket& socket, F&& each) {
        int turn = datagrams_per_turn;
        bool more = true;
        while (socket.is_open() && turn > 0 && (!empty() || more)) {
            --turn;
            if (empty()) {
                more = fetch(socket);
            } else {
                each(take());
            }
        }
        return !empty() && socket.is_open();
    }

    /// Fetches what is there, without waiting. True where there may be more: as many came as there is room for, or the
    /// network told of something else. \pre empty
    bool fetch(boost::asio::ip::udp::socket& socket) noexcept;

  private:
    static constexpr int datagrams_per_turn = 256; // about, since fetches count as well; then others have theirs
    static constexpr std::size_t longest = 1U << 16U;
    using text = std::array<char, longest>;
    struct control {
        alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> bytes;
    };

    [[nodiscard]] std::size_t length_of_each(std::size_t place) noexcept;

    std::unique_ptr<std::array<text, most>> texts_;
    std::array<endpoint, most> senders_;
    std::array<iovec, most> places_;
    std::array<control, most> controls_;
    std::array<mmsghdr, most> headers_;
    std::size_t next_ = 0;
    std::size_t taken_ = 0; // of that place
    std::size_t count_ = 0;
};

} // namespace cles::transport
