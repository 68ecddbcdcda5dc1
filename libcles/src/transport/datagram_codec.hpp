// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <boost/asio/ip/address.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/container_hash/hash.hpp>
#include <boost/system/error_code.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace cles::transport {

/// Who sends datagrams: an address, and with a codec also the number of the member that has proved that it is there.
struct datagram_origin {
    boost::asio::ip::udp::endpoint at{};
    std::uint32_t member = 0;

    bool operator==(const datagram_origin&) const = default;

    struct hash {
        std::size_t operator()(const datagram_origin& o) const noexcept {
            std::size_t seed = o.at.port();
            boost::hash_combine(seed, o.member);
            boost::hash_combine(seed, std::hash<boost::asio::ip::address>{}(o.at.address()));
            return seed;
        }
    };
};

/// Seals what a UDP socket sends, and opens what it receives. It exchanges datagrams of its own with the other ends.
class datagram_codec {
  public:
    using endpoint = boost::asio::ip::udp::endpoint;

    /// The socket. Everything is valid during the call; each function may call any function of the codec but `receive`.
    class carrier {
      public:
        carrier() = default;
        carrier(const carrier&) = delete;
        carrier& operator=(const carrier&) = delete;

        /// Sends a datagram; it may be lost.
        virtual void transmit(const endpoint& to, std::string_view datagram) = 0;
        /// A line has arrived, once. `established` has been called for its session.
        virtual void on_opened(const datagram_origin& from, std::uint32_t epoch, std::string_view line) = 0;
        /// The other end has stated its epoch.
        virtual void on_established(const datagram_origin& with, std::uint32_t epoch) = 0;
        /// The other end did not answer. \param lost there is no session with it, so lines to it are lost
        virtual void on_unanswered(const datagram_origin& with, bool lost) = 0;
        /// It is no longer a member, or another one.
        virtual void on_removed(std::uint32_t member) = 0;
        /// Whether requests to that end may still wait for their replies, so that its restart must be noticed.
        [[nodiscard]] virtual bool holds(const datagram_origin& which) const = 0;

      protected:
        ~carrier() = default;
    };

    datagram_codec() = default;
    datagram_codec(const datagram_codec&) = delete;
    datagram_codec& operator=(const datagram_codec&) = delete;
    virtual ~datagram_codec() = default;

    /// Called once, before all others. The socket must live until `stop`.
    virtual void start(carrier& owner) = 0;
    /// May be called from inside a function of the socket.
    virtual void stop() = 0;

    virtual void receive(const endpoint& from, std::string_view datagram) = 0;
    /// Seals a line without its LF, and transmits it now, or when the other end has proved who it is.
    virtual void send(const datagram_origin& to, std::string_view line) = 0;
    /// Begins a session with the other end, unless one is beginning.
    virtual void contact(const datagram_origin& with) = 0;
    /// A request that was sent at `since` is sent again: the other end may have restarted.
    virtual void check_peer(const datagram_origin& with, time_point since) = 0;
    /// The socket no longer `holds` it.
    virtual void release(const datagram_origin& which) = 0;
    [[nodiscard]] virtual std::string name_of(std::uint32_t member) const = 0;
};

/// The member that a link is to reach.
struct sealed_peer {
    std::unique_ptr<datagram_codec> codec;
    std::uint32_t member = 0;
    std::string name;
};
/// Called when the address is known; without a codec, the link fails with the code.
using sealed_peer_maker = std::function<sealed_peer(boost::system::error_code& code)>;

} // namespace cles::transport
