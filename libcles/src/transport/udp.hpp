// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "protocol/request_line.hpp"
#include "transport/datagram_codec.hpp"
#include "transport/datagram_io.hpp"

#include <boost/asio/ip/udp.hpp>
#include <boost/unordered/unordered_flat_map.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::transport {

class udp_port;

/// A link over datagrams: one peer of a socket, which it may share with other links. Each line is a datagram.
class udp_link final : public link, public std::enable_shared_from_this<udp_link> {
  public:
    [[gnu::cold]] udp_link(std::shared_ptr<udp_port> socket, datagram_origin peer, identity who);
    udp_link(const udp_link&) = delete;
    udp_link& operator=(const udp_link&) = delete;
    ~udp_link() override;

    [[gnu::cold]] void start(std::shared_ptr<link_events> owner) override;
    std::string& output() override { return output_; }
    [[nodiscard]] std::size_t datagram() const noexcept override { return protocol::datagram_bytes; }
    void flush() override;
    [[nodiscard]] std::size_t unsent() const noexcept override {
        return output_.size() + sending_.size() - sending_at_;
    }
    [[nodiscard]] std::uint64_t sent() const noexcept override { return sent_; }
    [[nodiscard]] std::uint64_t received() const noexcept override { return received_; }
    /// What arrives meanwhile is dropped: a datagram may be lost at any time.
    void pause(bool stop) override { paused_ = stop; }
    [[gnu::cold]] void finish() override;
    [[gnu::cold]] void close() override;
    [[nodiscard]] std::size_t buffered() const noexcept override { return output_.capacity() + sending_.capacity(); }
    [[gnu::cold]] void shrink() override;
    [[nodiscard]] const identity& peer() const noexcept override { return who_; }
    [[nodiscard]] std::string_view epoch() const noexcept override { return epoch_; }
    void check_peer(time_point since) override;

    // For `udp_dialler`, before the link has its owner.
    /// Asks the peer for a sign of life: a session with it if there is a codec, otherwise the reply to a request.
    [[gnu::cold]] void ask();
    /// \param begun is called when the first session has begun
    [[gnu::cold]] void await_session(std::function<void()> begun) { on_session_ = std::move(begun); }

    // For the port.
    [[nodiscard]] const datagram_origin& origin() const noexcept { return peer_; }
    /// Notes the epoch that the peer has stated. Returns whether it had stated another one.
    bool note_epoch(std::uint32_t epoch);
    /// The peer has stated its epoch.
    [[gnu::cold]] void on_session();
    /// The peer has restarted, and this is the only link of the socket.
    [[gnu::cold]] void on_restart();
    [[gnu::cold]] void on_unanswered(bool lost);
    /// Ends, and informs the owner.
    [[gnu::cold]] void lose(boost::system::error_code why);
    /// Delivers what arrived in a datagram.
    void deliver(std::string_view datagram);
    /// The socket is writable again.
    [[gnu::cold]] void on_writable();

  private:
    [[gnu::cold]] void deliver_early();
    void take_output();
    void send_rest();

    std::shared_ptr<udp_port> port_; // null: closed
    datagram_origin peer_;
    identity who_;
    std::optional<std::uint32_t> epoch_number_;
    std::string epoch_;
    std::shared_ptr<link_events> owner_;
    std::function<void()> on_session_;
    std::vector<std::string> early_; // received before `start`
    std::string output_;
    std::string sending_; // output for which the socket has no space
    std::size_t sending_at_ = 0;
    std::uint64_t sent_ = 0;
    std::uint64_t received_ = 0;
    bool paused_ = false;
    bool waiting_ = false; // until the socket is writable
};

/// A UDP socket and the links that share it: one for each source if it listens, or a single one if it was dialled.
///
/// It lives until it is closed and its last link is closed: the links own it, and their owners own them. Each wake-up
/// delivers up to a number of datagrams; then other tasks run. In steady state it allocates nothing.
///
/// With a codec, it sends and receives only what that has sealed, and a source is also one member.
class udp_port final : public acceptor, public std::enable_shared_from_this<udp_port>, private datagram_codec::carrier {
  public:
    using udp = boost::asio::ip::udp;

    [[gnu::cold]] explicit udp_port(udp::socket socket, std::unique_ptr<datagram_codec> codec = nullptr);

    /// Listens: from now on, each new source becomes a link.
    [[gnu::cold]] void start(std::function<void(link_ptr)> on_link) override;
    /// The only link of a connected socket.
    [[gnu::cold]] std::shared_ptr<udp_link> connect_link(const udp::endpoint& peer, identity who,
                                                         std::uint32_t member = 0);
    /// Accepts no new sources.
    [[gnu::cold]] void close() override;
    [[nodiscard, gnu::cold]] url local() const override;

    // For its links.
    void receive();
    /// Sends whole lines, each with its LF as one datagram, as long as the socket has space. One that cannot be sent
    /// counts as lost in the network.
    core::datagrams_done send(const udp_link& to, std::string_view lines);
    [[gnu::cold]] void wait_until_writable(std::weak_ptr<udp_link> link);
    [[gnu::cold]] void forget(const udp_link& link);
    void check_peer(const udp_link& link, time_point since);
    /// Begins a session. Returns false if there is no codec.
    [[gnu::cold]] bool contact(const udp_link& link);
    [[nodiscard]] udp::socket::executor_type executor() { return socket_.get_executor(); }

  private:
    void on_readable(boost::system::error_code code);
    void hand_over();
    void take(const receive_batch::datagram& one);
    [[gnu::cold]] void on_writable();
    [[nodiscard]] udp_link* find(const udp::endpoint& sender, std::uint32_t member);
    [[gnu::cold]] std::shared_ptr<udp_link> accept(const udp::endpoint& sender, std::uint32_t member,
                                                   std::uint32_t epoch);
    core::datagrams_done send_sealed(const udp_link& to, std::string_view lines);
    [[nodiscard]] const udp::endpoint* address_of(const udp::endpoint& to) const noexcept {
        return connected_ ? nullptr : &to;
    }
    [[gnu::cold]] void close_if_done();

    // datagram_codec::carrier
    void transmit(const udp::endpoint& to, std::string_view datagram) override;
    void on_opened(const datagram_origin& from, std::uint32_t epoch, std::string_view line) override;
    void on_established(const datagram_origin& with, std::uint32_t epoch) override;
    void on_unanswered(const datagram_origin& with, bool lost) override;
    [[gnu::cold]] void on_removed(std::uint32_t member) override;
    [[nodiscard]] bool holds(const datagram_origin& which) const override { return links_.contains(which); }

    udp::socket socket_;
    send_batch burst_{socket_};
    bool connected_ = false;
    bool receiving_ = false;
    std::function<void(link_ptr)> on_link_;
    boost::unordered_flat_map<datagram_origin, udp_link*, datagram_origin::hash> links_; // links remove themselves
    udp_link* recent_ = nullptr; // usually the source of the previous datagram
    receive_batch arrived_;
    std::vector<std::weak_ptr<udp_link>> waiting_; // for the socket to be writable
    std::unique_ptr<datagram_codec> codec_;        // null: lines are sent as they are
    std::string sealed_;                           // what is being sent
    std::vector<std::uint16_t> sizes_;             // of the datagrams in it
    bool sealing_ = false;
};

/// As `link_transport::listen` and `dial`.
[[gnu::cold]] std::unique_ptr<acceptor> listen_udp(const boost::asio::any_io_executor& executor, const url& where,
                                                   std::unique_ptr<datagram_codec> codec = nullptr);
[[gnu::cold]] std::function<void()> dial_udp(const boost::asio::any_io_executor& executor, const url& where,
                                             const limits& bounds, dial_callback done, sealed_peer_maker peer = {});

} // namespace cles::transport
