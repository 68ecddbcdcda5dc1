// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "transport/datagram_batch.hpp"
#include "transport/datagram_burst.hpp"
#include "transport/udp_link.hpp"

#include <boost/asio/ip/udp.hpp>
#include <boost/unordered/unordered_flat_map.hpp>

#include <cstddef>
#include <functional>
#include <memory>
#include <string_view>
#include <vector>

namespace cles::transport {

/// A UDP socket and the links that share it: one for each source where it listens, one alone where it was dialled.
///
/// It lives until it is closed and its last link is; it is the links that keep it, and their owners that keep them. A
/// wake-up hands over what there is, up to a number of datagrams;
/// then others have their turn. In steady state it allocates nothing.
class udp_port : public std::enable_shared_from_this<udp_port> {
  public:
    using udp = boost::asio::ip::udp;

    explicit udp_port(udp::socket socket);

    /// Listens: from now on, each source that sends something becomes a link.
    void accept(std::function<void(link_ptr)> on_link);
    /// The one link of a socket that is connected.
    link_ptr connect_link(const udp::endpoint& peer, identity who);
    /// Nobody comes in any more.
    void close();
    [[nodiscard]] udp::endpoint local() const;

    // For its links.
    void receive();
    /// Sends whole lines, each with its LF as a datagram. One that cannot be sent is as good as lost on its way.
    /// \return what is done; nothing: the socket has no room just now \pre there is a line
    core::lines_done send(const udp_link& to, std::string_view lines);
    void wait_for_room(std::weak_ptr<udp_link> link);
    void forget(const udp_link& link);
    [[nodiscard]] udp::socket::executor_type executor() { return socket_.get_executor(); }

  private:
    struct endpoint_hash {
        std::size_t operator()(const udp::endpoint& e) const noexcept;
    };

    void hand_over();
    void hand_over(const datagram_batch::datagram& one);
    std::shared_ptr<udp_link> link_of(const udp::endpoint& sender);
    void close_if_done();

    udp::socket socket_;
    datagram_burst burst_{socket_};
    bool connected_ = false;
    bool receiving_ = false;
    std::function<void(link_ptr)> on_link_;
    boost::unordered_flat_map<udp::endpoint, udp_link*, endpoint_hash> links_; // which take themselves out
    udp_link* recent_ = nullptr; // most datagrams come from where the one before came from
    std::vector<std::weak_ptr<udp_link>> waiting_;
    datagram_batch arrived_;
};

} // namespace cles::transport
