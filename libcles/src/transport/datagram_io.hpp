// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/group_port.hpp"

#include <boost/asio/ip/udp.hpp>
#include <boost/system/error_code.hpp>

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <string_view>

#include <sys/socket.h>

namespace cles::transport {

/// Sends datagrams, as many as one system call takes (sendmmsg(2)). Consecutive ones of one length pass through the
/// system as one, until the network device, or a socket that does not accept them so, splits them (UDP_SEGMENT,
/// udp(7)): routing is most of the cost of a datagram.
///
/// If the system or the interface does not support this, each is sent on its own.
class send_batch {
  public:
    using udp = boost::asio::ip::udp;

    /// \pre the socket outlives this, and is non-blocking
    explicit send_batch(udp::socket& socket) noexcept;

    /// Sends to the connected peer, or else to `to`. A datagram that cannot be sent counts as failed, as lost in the
    /// network, and as done. \return what is done; nothing if there is no space \pre there is one
    core::datagrams_done send(core::datagram_list all, const udp::endpoint* to = nullptr) noexcept;
    /// The same, as long as there is space.
    core::datagrams_done send_all(core::datagram_list all, const udp::endpoint* to) noexcept;

  private:
    // Nothing: the first run cannot be sent as one.
    std::optional<core::datagrams_done> send_runs(core::datagram_list all, std::size_t longest,
                                                  const udp::endpoint* to) noexcept;

    udp::socket& socket_;
    bool segments_;
};

/// Datagrams that one system call has received, each with its source, to be taken one by one. If the consumer throws,
/// those not yet taken remain.
///
/// Those of one sender that the system combines (UDP_GRO, udp(7)) share one place. Each place is large enough for all
/// of them; its memory is used only as far as data has arrived there, unless the program locks its memory.
class receive_batch {
  public:
    using endpoint = boost::asio::ip::udp::endpoint;
    static constexpr std::size_t most = 4; ///< places

    receive_batch();
    receive_batch(const receive_batch&) = delete;
    receive_batch& operator=(const receive_batch&) = delete;

    struct datagram {
        const endpoint& from;
        std::string_view text; ///< both valid until the next `fetch`
    };
    [[nodiscard]] bool empty() const noexcept { return next_ == count_; }
    /// \pre not empty
    datagram take() noexcept;

    /// Makes a socket non-blocking, lets a burst wait in it while other tasks run, and lets the system combine
    /// datagrams that arrive together, if it can.
    static void prepare(boost::asio::ip::udp::socket& socket) noexcept;

    /// Receives datagrams and passes each to `each`, up to a number per turn; what `each` throws passes through. Ends
    /// if the socket is closed meanwhile. \return whether some may be left for the next turn: do not wait for more
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

    /// The same. If something is left, also because `each` throws, calls `go_on_soon`, which has this called again in
    /// another turn. \return whether nothing is left: wait for more
    template <class F, class G>
    [[nodiscard]] bool hand_over_in_turns(boost::asio::ip::udp::socket& socket, F&& each, G&& go_on_soon) {
        bool left = false;
        try {
            left = hand_over(socket, each);
        } catch (...) { // of a handler, for the thread that runs the context; other datagrams are not affected
            go_on_soon();
            throw;
        }
        if (left) {
            go_on_soon();
        }
        return !left;
    }

    /// Receives without waiting. Returns true if there may be more: all places were filled, or the network reported an
    /// error. \pre empty
    bool fetch(boost::asio::ip::udp::socket& socket) noexcept;

  private:
    static constexpr int datagrams_per_turn = 256; // approximate, since fetches count as well
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
    std::size_t taken_ = 0; // position in the place of `next_`
    std::size_t count_ = 0;
};

} // namespace cles::transport
