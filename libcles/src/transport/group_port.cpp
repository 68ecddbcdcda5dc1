// SPDX-License-Identifier: BSL-1.0
#include "transport/group_port.hpp"

#include "transport/multicast_socket.hpp"

#include <boost/asio/error.hpp>

#include <utility>

namespace cles::transport {
namespace asio = boost::asio;
using boost::system::error_code;

group_port::group_port(const asio::any_io_executor& executor, const core::network_interface& by,
                       const multicast_options& where)
    : group_(asio::ip::make_address_v4(where.group), where.port), receiver_(group_receiver::of(executor, by, group_)),
      own_(executor, udp::v4()), burst_(own_) {
    own_.bind({asio::ip::address_v4{by.address}, 0});
    set_ip_option(own_, IP_MULTICAST_IF, membership(group_, by.index));
    set_ip_option(own_, IP_MULTICAST_TTL, 1);
    set_ip_option(own_, IP_MULTICAST_LOOP, 1); // for other nodes of this host
    own_.non_blocking(true);
    drop_all(own_); // nothing reads from it
    source_ = source_of(own_.local_endpoint());
}

void group_port::start(core::group_listener& owner) {
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

core::lines_done group_port::send(std::string_view lines) {
    if (!own_.is_open()) {
        return {.bytes = lines.size()}; // all of it is lost
    }
    core::lines_done taken;
    bool room = unsent() == 0;
    while (room && taken.bytes < lines.size()) {
        const auto sent = burst_.send(lines.substr(taken.bytes), &group_);
        taken.lines += sent.lines;
        taken.bytes += sent.bytes;
        room = sent.lines != 0;
    }
    while (taken.bytes < lines.size()) {
        const auto line = lines.substr(taken.bytes, lines.find('\n', taken.bytes) + 1 - taken.bytes);
        if (unsent() + line.size() > max_waiting) {
            break;
        }
        waiting_.append(line);
        ++taken.lines;
        taken.bytes += line.size();
    }
    wait_for_room();
    return taken;
}

void group_port::wait_for_room() {
    if (unsent() == 0 || waits_for_room_) {
        return;
    }
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

void group_port::send_rest() {
    while (unsent() != 0) {
        const auto sent = burst_.send(std::string_view{waiting_}.substr(waiting_at_), &group_);
        if (sent.lines == 0) {
            wait_for_room();
            return;
        }
        waiting_at_ += sent.bytes;
    }
    waiting_.clear();
    waiting_at_ = 0;
}

} // namespace cles::transport
