// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "protocol/request_line.hpp"

#include <boost/container_hash/hash.hpp>
#include <boost/system/error_code.hpp>

#include <compare>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// A network interface of this host, as far as IPv4 multicast needs it.
struct network_interface {
    std::string name{};
    int index = 0;
    std::uint32_t address = 0; ///< the first one; 127.0.0.1 is 0x7f000001; 0: none
    bool loopback = false;
    bool up = false;             ///< switched on
    bool running = false;        ///< up, and with a link
    bool multicast = false;      ///< as the system reports it: false for loopback, which works nevertheless
    bool point_to_point = false; ///< such as a tunnel
};

/// The interfaces that a node with `auto` uses for multicast (cles/multicast.hpp): loopback first.
std::vector<network_interface> automatic(std::vector<network_interface> all);

/// The sender of a datagram to the group: the IPv4 address and port of a socket that belongs to one node for as long as
/// it runs.
struct group_source {
    std::uint32_t address = 0; ///< 127.0.0.1 is 0x7f000001
    std::uint16_t port = 0;

    // NOLINTNEXTLINE(modernize-use-nullptr): clang-tidy 14 takes the resulting zero for a pointer
    auto operator<=>(const group_source&) const = default;
    [[nodiscard]] bool is_loopback() const noexcept { return address >> 24U == 127; }
};

inline std::size_t hash_value(const group_source& s) noexcept {
    std::size_t seed = s.port;
    boost::hash_combine(seed, s.address);
    return seed;
}

/// "10.0.0.2"
std::string host_text(const group_source& s);
/// "10.0.0.2:4000"
std::string to_text(const group_source& s);
/// Parses that; nothing if it is anything else.
std::optional<group_source> parse_group_source(std::string_view text) noexcept;

/// Whether a datagram that was opened counts: each does once. Asked when its source has been checked.
class datagram_admission {
  public:
    datagram_admission() = default;
    datagram_admission(const datagram_admission&) = delete;
    datagram_admission& operator=(const datagram_admission&) = delete;
    /// \param is_signed it has a valid signature, so its `seq` shows whether it is a repeat
    [[nodiscard]] virtual bool accept(bool is_signed) = 0;

    enum class repetition : std::uint8_t {
        first, ///< no announcement of that incarnation with this `seq` or a greater one has counted
        again, ///< it may be the last one, received by another of several interfaces
        refused,
    };
    /// The same for an announcement with a valid signature, of the incarnation that the sender has confirmed.
    [[nodiscard]] virtual repetition accept_announcement(std::uint64_t seq) = 0;

  protected:
    ~datagram_admission() = default;
};

/// A datagram from a multicast group, parsed once for all nodes that receive it; valid during the call.
struct group_datagram {
    const group_source& from;
    std::string_view text;
    const protocol::request_line* request; ///< null: not valid in a group
    bool to_group = true;                  ///< otherwise it was sent to this node's own source
    std::string_view member{};             ///< the authenticated sender, of a secured fleet
    std::uint32_t epoch = 0;               ///< which the sender has confirmed
    datagram_admission* admission = nullptr;

    /// Whether it counts; see `datagram_admission`.
    [[nodiscard]] bool accept(bool is_signed = false) const {
        return admission == nullptr || admission->accept(is_signed);
    }
    [[nodiscard]] datagram_admission::repetition accept_announcement(std::uint64_t seq) const {
        return admission == nullptr ? datagram_admission::repetition::first : admission->accept_announcement(seq);
    }
};

/// Receives what arrives from a multicast group.
class group_listener {
  public:
    group_listener() = default;
    group_listener(const group_listener&) = delete;
    group_listener& operator=(const group_listener&) = delete;

    /// Also called for a node's own datagrams if other nodes use the same socket.
    virtual void on_datagram(const group_datagram& datagram) = 0;
    /// What was pending has been sent.
    virtual void on_writable() = 0;

  protected:
    ~group_listener() = default;
};

/// Datagrams to send, one behind the other: whole lines, each with its LF, or texts of given sizes.
class datagram_list {
  public:
    template <std::convertible_to<std::string_view> Text>
    // NOLINTNEXTLINE(google-explicit-constructor): lines are such a list
    datagram_list(const Text& lines) noexcept : bytes_(lines) {}
    datagram_list(std::string_view bytes, std::span<const std::uint16_t> sizes) noexcept
        : bytes_(bytes), sizes_(sizes), sized_(true) {}

    [[nodiscard]] bool empty() const noexcept { return bytes_.empty(); }
    [[nodiscard]] std::string_view bytes() const noexcept { return bytes_; }
    /// \pre not empty
    [[nodiscard]] std::string_view first() const noexcept {
        return bytes_.substr(0, sized_ ? sizes_.front() : bytes_.find('\n') + 1);
    }
    void drop_first() noexcept {
        bytes_.remove_prefix(first().size());
        sizes_ = sized_ ? sizes_.subspan(1) : sizes_;
    }

  private:
    std::string_view bytes_;
    std::span<const std::uint16_t> sizes_;
    bool sized_ = false;
};

/// How many datagrams, and bytes of them, have been dealt with: they were sent, or are pending.
struct datagrams_done {
    std::size_t count = 0;
    std::size_t bytes = 0;
    std::size_t failed = 0;          ///< how many the system did not send: of these, or that were pending before
    boost::system::error_code why{}; ///< the last one of those
};

/// A node's endpoint in a multicast group on one interface: receives the group, and sends from an address and port that
/// belong to this node for as long as it runs.
class group_port {
  public:
    group_port() = default;
    group_port(const group_port&) = delete;
    group_port& operator=(const group_port&) = delete;
    virtual ~group_port() = default;

    /// Starts to deliver what arrives. The listener must live until `close`.
    virtual void start(group_listener& owner) = 0;
    /// Sends to the group; datagrams for which the socket has no space are pending. One that cannot be sent for another
    /// reason counts as failed, and as lost in the network.
    /// \return less than everything if the limit on pending bytes is reached
    virtual datagrams_done send(datagram_list all) = 0;
    /// Sends one datagram to a source in the group, which receives it if it has called `receive_own`. If the socket has
    /// no space, it is lost.
    virtual void send_to(const group_source& to, std::string_view datagram) = 0;
    /// From now on, also delivers what is sent to `source`.
    virtual void receive_own() = 0;
    /// Bytes that are pending.
    [[nodiscard]] virtual std::size_t unsent() const noexcept = 0;
    virtual void close() = 0;
    /// The source of what this node sends.
    [[nodiscard]] virtual const group_source& source() const noexcept = 0;
};

} // namespace cles::core
