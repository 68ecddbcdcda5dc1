// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include "port/group_port.hpp"
#include "transport/datagram_io.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/system/error_code.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::transport {

class group_receiver;

/// The socket that nodes on this executor share, or a new one, which joins. \throws boost::system::system_error
std::shared_ptr<group_receiver> receiver_of(const boost::asio::any_io_executor& executor,
                                            const core::network_interface& by,
                                            const boost::asio::ip::udp::endpoint& group);

/// An endpoint in a multicast group over UDP: receives through a socket that nodes on one executor share, and sends
/// through its own.
class group_port final : public core::group_port, public std::enable_shared_from_this<group_port> {
  public:
    using udp = boost::asio::ip::udp;

    /// Joins the group. \throws boost::system::system_error
    [[gnu::cold]] group_port(const boost::asio::any_io_executor& executor, const core::network_interface& by,
                             const multicast_options& where);

    [[gnu::cold]] void start(core::group_listener& owner) override;
    core::datagrams_done send(core::datagram_list all) override;
    void send_to(const core::group_source& to, std::string_view datagram) override;
    [[gnu::cold]] void receive_own() override;
    [[nodiscard]] std::size_t unsent() const noexcept override { return waiting_.size() - waiting_at_; }
    [[gnu::cold]] void close() override;
    [[nodiscard]] const core::group_source& source() const noexcept override { return source_; }

    static constexpr std::size_t max_waiting = 1U << 16U;

  private:
    [[gnu::cold]] void send_rest();
    [[gnu::cold]] void wait_until_writable();
    [[gnu::cold]] void on_writable(boost::system::error_code code);
    void wait_for_own();
    void on_own(boost::system::error_code code);
    void deliver_own();

    udp::endpoint group_;
    core::group_source source_;
    std::shared_ptr<group_receiver> receiver_;
    udp::socket own_;
    send_batch burst_;
    core::group_listener* owner_ = nullptr;    // null: closed
    std::string waiting_;                      // pending datagrams
    std::vector<std::uint16_t> waiting_sizes_; // of each
    std::size_t waiting_at_ = 0;               // bytes of them that were sent
    std::size_t waiting_sent_ = 0;             // how many were sent
    std::size_t failed_ = 0;                   // of them, not reported yet
    boost::system::error_code why_;
    std::optional<receive_batch> own_arrived_; // once it receives what is sent to `source`
    bool waits_until_writable_ = false;
};

} // namespace cles::transport
