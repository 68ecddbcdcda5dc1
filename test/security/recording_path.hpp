// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/udp.hpp>

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::security::test {

/// A path between one client at a time and the UDP port of a node, which keeps all datagrams, and can send them again
/// from the same addresses.
class recording_path {
  public:
    using udp = boost::asio::ip::udp;

    recording_path(boost::asio::io_context& io, std::uint16_t port)
        : client_side_(io, {boost::asio::ip::address_v4::loopback(), 0}),
          node_side_(io, {boost::asio::ip::address_v4::loopback(), 0}),
          node_(boost::asio::ip::address_v4::loopback(), port) {
        client_side_.non_blocking(true);
        node_side_.non_blocking(true);
        receive(client_side_, true);
        receive(node_side_, false);
    }

    [[nodiscard]] std::string url() const {
        return "udp://127.0.0.1:" + std::to_string(client_side_.local_endpoint().port());
    }
    /// Returns whether to drop a datagram; may be empty.
    std::function<bool(std::string_view datagram, bool to_node)> drop;

    /// Everything so far, by direction.
    std::vector<std::string> to_node;
    std::vector<std::string> to_client;

    /// Sends all that has been kept once more.
    void replay() {
        for (const auto& each : std::vector{to_node}) {
            node_side_.send_to(boost::asio::buffer(each), node_);
        }
        for (const auto& each : std::vector{to_client}) {
            client_side_.send_to(boost::asio::buffer(each), client_);
        }
    }

  private:
    void receive(udp::socket& from, bool is_for_node) {
        from.async_wait(udp::socket::wait_read, [this, &from, is_for_node](boost::system::error_code code) {
            if (code) {
                return;
            }
            boost::system::error_code failed;
            udp::endpoint sender;
            for (;;) {
                const auto size = from.receive_from(boost::asio::buffer(text_), sender, 0, failed);
                if (failed == boost::asio::error::would_block) {
                    break;
                }
                if (!failed) {
                    pass({text_.data(), size}, sender, is_for_node);
                }
            }
            receive(from, is_for_node);
        });
    }
    void pass(std::string_view datagram, const udp::endpoint& sender, bool is_for_node) {
        if (is_for_node) {
            client_ = sender;
        }
        (is_for_node ? to_node : to_client).emplace_back(datagram);
        if (!drop || !drop(datagram, is_for_node)) {
            boost::system::error_code ignored;
            (is_for_node ? node_side_ : client_side_)
                .send_to(boost::asio::buffer(datagram), is_for_node ? node_ : client_, 0, ignored);
        }
    }

    udp::socket client_side_;
    udp::socket node_side_;
    udp::endpoint node_;
    udp::endpoint client_;
    std::array<char, 65536> text_{};
};

} // namespace cles::security::test
