// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "protocol/request_line.hpp"
#include "transport/datagram_io.hpp"

#include <boost/asio/ip/udp.hpp>
#include <boost/unordered/unordered_flat_map.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::transport {

class udp_port;

/// A link over datagrams: one peer of a socket, which it may share with other links. Each line is a datagram.
class udp_link final : public link, public std::enable_shared_from_this<udp_link> {
  public:
    udp_link(std::shared_ptr<udp_port> socket, boost::asio::ip::udp::endpoint peer, identity who);
    udp_link(const udp_link&) = delete;
    udp_link& operator=(const udp_link&) = delete;
    ~udp_link() override;

    void start(std::shared_ptr<link_events> owner) override;
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
    void finish() override;
    void close() override;
    [[nodiscard]] std::size_t buffered() const noexcept override { return output_.capacity() + sending_.capacity(); }
    void shrink() override;
    [[nodiscard]] const identity& peer() const noexcept override { return who_; }

    // For the port.
    [[nodiscard]] const boost::asio::ip::udp::endpoint& endpoint() const noexcept { return peer_; }
    /// Delivers what arrived in a datagram.
    void deliver(std::string_view datagram);
    /// The socket is writable again.
    void on_writable();

  private:
    void take_output();
    void send_rest();

    std::shared_ptr<udp_port> port_; // null: closed
    boost::asio::ip::udp::endpoint peer_;
    identity who_;
    std::shared_ptr<link_events> owner_;
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
class udp_port final : public acceptor, public std::enable_shared_from_this<udp_port> {
  public:
    using udp = boost::asio::ip::udp;

    explicit udp_port(udp::socket socket);

    /// Listens: from now on, each new source becomes a link.
    void start(std::function<void(link_ptr)> on_link) override;
    /// The only link of a connected socket.
    link_ptr connect_link(const udp::endpoint& peer, identity who);
    /// Accepts no new sources.
    void close() override;
    [[nodiscard]] url local() const override;

    // For its links.
    void receive();
    /// Sends whole lines, each with its LF as one datagram, as long as the socket has space. One that cannot be sent
    /// counts as lost in the network.
    core::datagrams_done send(const udp_link& to, std::string_view lines);
    void wait_until_writable(std::weak_ptr<udp_link> link);
    void forget(const udp_link& link);
    [[nodiscard]] udp::socket::executor_type executor() { return socket_.get_executor(); }

  private:
    struct endpoint_hash {
        std::size_t operator()(const udp::endpoint& e) const noexcept;
    };

    void hand_over();
    void hand_over(const receive_batch::datagram& one);
    std::shared_ptr<udp_link> link_of(const udp::endpoint& sender);
    void close_if_done();

    udp::socket socket_;
    send_batch burst_{socket_};
    bool connected_ = false;
    bool receiving_ = false;
    std::function<void(link_ptr)> on_link_;
    boost::unordered_flat_map<udp::endpoint, udp_link*, endpoint_hash> links_; // links remove themselves
    udp_link* recent_ = nullptr; // usually the source of the previous datagram
    receive_batch arrived_;
};

} // namespace cles::transport
