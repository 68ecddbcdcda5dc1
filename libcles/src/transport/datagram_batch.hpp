// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/ip/udp.hpp>
#include <boost/system/error_code.hpp>

#include <array>
#include <cstddef>
#include <string_view>

#include <sys/socket.h>

namespace cles::transport {

/// Datagrams that one system call has fetched, each with where it came from, to be taken one by one. What has not been
/// taken when its taker throws is still there.
class datagram_batch {
  public:
    using endpoint = boost::asio::ip::udp::endpoint;
    static constexpr std::size_t most = 16;

    datagram_batch() noexcept;
    datagram_batch(const datagram_batch&) = delete;
    datagram_batch& operator=(const datagram_batch&) = delete;

    struct datagram {
        const endpoint& from;
        std::string_view text; ///< both valid until the next `fetch`
    };
    [[nodiscard]] bool empty() const noexcept { return next_ == count_; }
    /// \pre not empty
    datagram take() noexcept;

    /// Fetches and hands over to `each` what is there, for one turn; what `each` throws passes through. Ends where the
    /// socket is closed meanwhile.
    template <class F>
    void hand_over(boost::asio::ip::udp::socket& socket, F&& each) {
        int turn = fetches_per_turn;
        bool more = true;
        while (socket.is_open() && (!empty() || (more && turn-- > 0))) {
            if (empty()) {
                more = fetch(socket);
            } else {
                each(take());
            }
        }
    }

    /// Fetches what is there, without waiting. True where there may be more: as many came as there is room for, or the
    /// network told of something else. \pre empty
    bool fetch(boost::asio::ip::udp::socket& socket) noexcept;

  private:
    static constexpr int fetches_per_turn = 16;  // then others have theirs
    static constexpr std::size_t longest = 1280; // more than one may have, so that what is longer shows

    std::array<std::array<char, longest>, most> texts_;
    std::array<endpoint, most> senders_;
    std::array<iovec, most> places_;
    std::array<mmsghdr, most> headers_;
    std::size_t next_ = 0;
    std::size_t count_ = 0;
};

} // namespace cles::transport
