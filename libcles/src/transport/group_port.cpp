// SPDX-License-Identifier: BSL-1.0
#include "transport/group_port.hpp"

#include "transport/group_socket_option.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/error.hpp>

#include <utility>

namespace cles::transport {
namespace asio = boost::asio;
using boost::system::error_code;

group_port::group_port(const asio::any_io_executor& executor, const ip_interface& by, const multicast_options& where)
    : group_(asio::ip::make_address_v4(where.group), where.port), receiver_(group_receiver::of(executor, by, group_)),
      own_(executor, udp::v4()) {
    own_.bind({by.address, 0});
    set_ip_option(own_, IP_MULTICAST_IF, membership(group_, by.index));
    set_ip_option(own_, IP_MULTICAST_TTL, 1);
    set_ip_option(own_, IP_MULTICAST_LOOP, 1); // other nodes of this host hear it too
    own_.non_blocking(true);
    source_ = own_.local_endpoint();
}

void group_port::start(group_events& owner) {
    owner_ = &owner;
    receiver_->add(owner, source_);
}

void group_port::close() {
    if (const auto* const owner = std::exchange(owner_, nullptr)) {
        receiver_->remove(*owner);
    }
    receiver_.reset();
    error_code ignored;
    own_.close(ignored);
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
