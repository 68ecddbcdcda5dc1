// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/multicast.hpp>
#include <boost/asio/ip/udp.hpp>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace cles::test {

/// Somebody in a group on loopback, without a key, who repeats everything from a source of its own: at once, as
/// programs do that connect networks, and again later.
class group_repeater {
  public:
    group_repeater(boost::asio::io_context& io, const multicast_options& where)
        : in_(io), out_(io, {boost::asio::ip::address_v4::loopback(), 0}),
          group_(boost::asio::ip::make_address(where.group), where.port) {
        namespace multicast = boost::asio::ip::multicast;
        in_.open(udp::v4());
        in_.set_option(udp::socket::reuse_address{true});
        in_.bind(group_);
        in_.set_option(multicast::join_group{group_.address().to_v4(), boost::asio::ip::address_v4::loopback()});
        out_.set_option(multicast::outbound_interface{boost::asio::ip::address_v4::loopback()});
        receive();
    }
    group_repeater(const group_repeater&) = delete;
    group_repeater& operator=(const group_repeater&) = delete;

    /// Repeats everything that it has received.
    void repeat_all() {
        for (const auto& each : heard_) {
            out_.send_to(boost::asio::buffer(each), group_);
        }
    }
    [[nodiscard]] std::size_t heard() const noexcept { return heard_.size(); }

  private:
    using udp = boost::asio::ip::udp;

    void receive() {
        in_.async_receive_from(boost::asio::buffer(room_), from_,
                               [this](boost::system::error_code code, std::size_t bytes) {
                                   if (code) {
                                       return;
                                   }
                                   if (from_ != out_.local_endpoint()) {
                                       heard_.emplace_back(room_.data(), bytes);
                                       out_.send_to(boost::asio::buffer(heard_.back()), group_);
                                   }
                                   receive();
                               });
    }

    udp::socket in_;
    udp::socket out_;
    udp::endpoint group_;
    udp::endpoint from_;
    std::array<char, 2000> room_{};
    std::vector<std::string> heard_;
};

} // namespace cles::test
