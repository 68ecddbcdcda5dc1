// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "protocol/datagram.hpp"

#include <boost/asio/ip/udp.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::transport {

class udp_port;

/// A link over datagrams: one peer of a socket that it may share with other links. Each line is a datagram.
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
    /// What comes meanwhile is dropped: a datagram may be lost at any time.
    void pause(bool stop) override { paused_ = stop; }
    void finish() override;
    void close() override;
    [[nodiscard]] std::size_t buffered() const noexcept override { return output_.capacity() + sending_.capacity(); }
    void shrink() override;
    [[nodiscard]] const identity& peer() const noexcept override { return who_; }

    // For the port.
    [[nodiscard]] const boost::asio::ip::udp::endpoint& endpoint() const noexcept { return peer_; }
    /// Hands over what came in a datagram.
    void deliver(std::string_view datagram);
    /// The socket takes datagrams again.
    void on_room();

  private:
    void take_output();
    void send_rest();

    std::shared_ptr<udp_port> port_; // null: closed
    boost::asio::ip::udp::endpoint peer_;
    identity who_;
    std::shared_ptr<link_events> owner_;
    std::vector<std::string> early_; // what came before it was started
    std::string output_;
    std::string sending_; // what is being sent, as far as the socket has no room for it
    std::size_t sending_at_ = 0;
    std::uint64_t sent_ = 0;
    std::uint64_t received_ = 0;
    bool paused_ = false;
    bool waiting_ = false; // for room in the socket
};

} // namespace cles::transport
