// SPDX-License-Identifier: BSL-1.0
#include "transport/member_handler.hpp"

#include <boost/asio/basic_socket_acceptor.hpp>
#include <boost/asio/generic/stream_protocol.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/post.hpp>

namespace cles::transport {
namespace asio = boost::asio;

template <class Device>
void wait(Device& device, typename Device::wait_type until, member_handler&& call) {
    device.async_wait(until, std::move(call));
}

template void wait(asio::ip::udp::socket& device, asio::socket_base::wait_type until, member_handler&& call);
template void wait(asio::generic::stream_protocol::socket& device, asio::socket_base::wait_type until,
                   member_handler&& call);
template void wait(asio::basic_socket_acceptor<asio::generic::stream_protocol>& device,
                   asio::socket_base::wait_type until, member_handler&& call);
template void wait(asio::posix::stream_descriptor& device, asio::posix::descriptor_base::wait_type until,
                   member_handler&& call);

void wait(asio::steady_timer& timer, member_handler&& call) { timer.async_wait(std::move(call)); }

void post(const asio::any_io_executor& executor, member_handler&& call, boost::system::error_code code) {
    asio::post(executor, [call = std::move(call), code] { call(code); });
}

} // namespace cles::transport
