// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "transport/address_dialler.hpp"
#include "transport/datagram_codec.hpp"

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/ip/address.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/system/error_code.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

namespace cles::transport {

class udp_link;

/// Makes the link to one address.
using udp_connector =
    std::function<std::shared_ptr<udp_link>(const boost::asio::ip::udp::endpoint& to, boost::system::error_code& code)>;

/// Makes the link to a host. If that has several addresses, finds out first at which of them a node answers datagrams:
/// it asks each `PULL self:cles`, or with a codec begins a session with it. A request that was sent to several
/// addresses might run several times, so it waits for the answer. The only address of a host is not asked.
class udp_dialler final : public address_dialler {
  public:
    /// The id of the question, which no other request by datagram has: theirs begin below 2^52, and are few.
    static constexpr std::uint64_t question_id = (std::uint64_t{1} << 53U) - 1;

    udp_dialler(const boost::asio::any_io_executor& executor, const limits& bounds, udp_connector connect,
                dial_callback done);

    /// `answered` is called with the number of the endpoint that has answered, just before `done`. May call them before
    /// it returns. \pre there is at least one
    void start(std::vector<boost::asio::ip::udp::endpoint> where, std::function<void(std::size_t)> answered);

  private:
    class question;
    struct attempt {
        std::size_t which;
        std::shared_ptr<udp_link> link;
    };

    void begin(std::size_t which) override;
    time_point ask_again(time_point now) override;
    void close_attempts() override;
    void on_answer(std::size_t which);
    void on_failed(std::size_t which, boost::system::error_code code);

    udp_connector connect_;
    std::vector<boost::asio::ip::udp::endpoint> where_;
    std::optional<probe_times> again_;
    std::vector<attempt> attempts_;
};

} // namespace cles::transport
