// SPDX-License-Identifier: BSL-1.0
#include "transport/group_port.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/post.hpp>
#include <boost/system/system_error.hpp>

#include <cerrno>

#include <netinet/in.h>
#include <sys/socket.h>

namespace cles::transport {
namespace asio = boost::asio;
using boost::system::error_code;

namespace {

template <class T>
void set_ip_option(asio::ip::udp::socket& socket, int option, const T& value) {
    if (::setsockopt(socket.native_handle(), IPPROTO_IP, option, &value, sizeof value) != 0) {
        throw boost::system::system_error{errno, boost::system::system_category()};
    }
}

ip_mreqn membership(const asio::ip::udp::endpoint& group, int interface) {
    ip_mreqn wanted{};
    wanted.imr_multiaddr.s_addr = htonl(group.address().to_v4().to_uint());
    wanted.imr_ifindex = interface;
    return wanted;
}

} // namespace

group_port::group_port(const asio::any_io_executor& executor, const ip_interface& by, const multicast_options& where)
    : group_(asio::ip::make_address_v4(where.group), where.port), shared_(executor, udp::v4()),
      own_(executor, udp::v4()) {
    shared_.set_option(asio::socket_base::reuse_address{true});
    set_ip_option(shared_, IP_MULTICAST_ALL, 0); // else it hears groups that other programs have joined
    shared_.bind(group_);
    set_ip_option(shared_, IP_ADD_MEMBERSHIP, membership(group_, by.index));
    shared_.non_blocking(true);
    error_code ignored;
    constexpr int room = 1 << 20; // a burst waits here while others have their turn
    shared_.set_option(asio::socket_base::receive_buffer_size{room}, ignored);

    own_.bind({by.address, 0});
    set_ip_option(own_, IP_MULTICAST_IF, membership(group_, by.index));
    set_ip_option(own_, IP_MULTICAST_TTL, 1);
    set_ip_option(own_, IP_MULTICAST_LOOP, 1); // other nodes of this host hear it too
    own_.non_blocking(true);
    source_ = own_.local_endpoint();
}

void group_port::start(group_events& owner) {
    owner_ = &owner;
    receive();
}

void group_port::close() {
    owner_ = nullptr;
    error_code ignored;
    shared_.close(ignored);
    own_.close(ignored);
}

// -- receiving -----------------------------------------------------------------------------------------------------

void group_port::receive() {
    if (owner_ == nullptr) {
        return;
    }
    shared_.async_wait(udp::socket::wait_read, [self = shared_from_this()](error_code code) {
        if (!code) {
            self->hand_over();
        }
    });
}

void group_port::hand_over() {
    try {
        arrived_.hand_over(shared_,
                           [this](const datagram_batch::datagram& one) { owner_->on_datagram(one.from, one.text); });
    } catch (...) { // a handler's, for whoever runs the context; the other datagrams are none of its business
        asio::post(shared_.get_executor(), [self = shared_from_this()] { self->hand_over(); });
        throw;
    }
    if (owner_ != nullptr) {
        owner_->on_batch();
    }
    receive();
}

// -- sending -------------------------------------------------------------------------------------------------------

bool group_port::try_to_send(std::string_view line) {
    error_code code;
    own_.send_to(asio::buffer(line.data(), line.size()), group_, 0, code);
    return code != asio::error::would_block;
}

bool group_port::send(std::string_view line) {
    if (!own_.is_open() || (unsent() == 0 && try_to_send(line))) {
        return true;
    }
    if (unsent() + line.size() > most_waiting) {
        return false;
    }
    waiting_.append(line);
    send_rest();
    return true;
}

void group_port::send_rest() {
    while (unsent() != 0) {
        const auto line =
            std::string_view{waiting_}.substr(waiting_at_, waiting_.find('\n', waiting_at_) + 1 - waiting_at_);
        if (!try_to_send(line)) {
            if (!waits_for_room_) {
                waits_for_room_ = true;
                own_.async_wait(udp::socket::wait_write, [self = shared_from_this()](error_code code) {
                    self->waits_for_room_ = false;
                    if (!code && self->owner_ != nullptr) {
                        self->send_rest();
                        if (self->unsent() == 0 && self->owner_ != nullptr) {
                            self->owner_->on_room();
                        }
                    }
                });
            }
            return;
        }
        waiting_at_ += line.size();
    }
    waiting_.clear();
    waiting_at_ = 0;
}

} // namespace cles::transport
