// SPDX-License-Identifier: BSL-1.0
#include "simulation/group_port.hpp"

#include <chrono>

namespace cles::simulation {
namespace {

constexpr unsigned room_in_system = 24;
constexpr std::chrono::milliseconds until_room{1};

} // namespace

// As `to_string` of an endpoint has it.
core::group_source group_port::source_of(const endpoint& where) noexcept {
    return {.address = 0x0A000001U + where.host, .port = static_cast<std::uint16_t>(where.port)};
}

void group_port::open(events& owner) {
    owner_ = &owner;
    net_.join(shared_from_this());
}

bool group_port::send(std::string_view line) {
    if (owner_ == nullptr) {
        return true;
    }
    if (waiting_.empty() && in_system_ < room_in_system) {
        pass_on(line);
        return true;
    }
    if (unsent_ + line.size() > most_waiting) {
        return false;
    }
    unsent_ += line.size();
    waiting_.emplace_back(line);
    return true;
}

void group_port::pass_on(std::string_view line) {
    const auto home = home_.lock();
    if (owner_ == nullptr || !home) {
        return;
    }
    net_.watcher().saw(to_string(local_), "==>", line);
    net_.multicast(local_, line);
    if (in_system_++ == 0) {
        home->later(until_room, [weak = weak_from_this()] {
            if (const auto self = weak.lock()) {
                self->drain();
            }
        });
    }
}

void group_port::drain() {
    in_system_ = 0;
    const bool waited = !waiting_.empty();
    while (!waiting_.empty() && in_system_ < room_in_system) {
        const auto line = std::move(waiting_.front());
        waiting_.pop_front();
        unsent_ -= line.size();
        pass_on(line);
    }
    if (waited && waiting_.empty() && owner_ != nullptr) {
        owner_->on_room();
    }
}

void group_port::receive(const endpoint& from, const std::string& datagram) {
    const auto home = home_.lock();
    constexpr std::size_t most_unread = 256; // what the system keeps for a process that does not fetch it
    if (home && home->waiting() < most_unread) {
        home->run([weak = weak_from_this(), from, datagram] {
            if (const auto self = weak.lock(); self && self->owner_ != nullptr) {
                self->owner_->on_datagram(source_of(from), datagram);
            }
        });
    }
}

} // namespace cles::simulation
