// SPDX-License-Identifier: BSL-1.0
#include "simulation/network/group_port.hpp"

#include "protocol/request_line.hpp"
#include "simulation/workload/part.hpp"
#include "simulation/world/node_run.hpp"

#include <chrono>
#include <utility>

namespace cles::simulation {
namespace {

constexpr unsigned first_port = 40'000;
constexpr unsigned system_capacity = 24;
constexpr std::chrono::milliseconds until_writable{1};

bool is_announcement(std::string_view line) {
    return line.starts_with("UPDATE ") && line.find(":cles ") != std::string_view::npos;
}
bool is_farewell(std::string_view line) {
    return is_announcement(line) && line.find("\"leaving\":true") != std::string_view::npos;
}

core::group_source source_of(const endpoint& where) noexcept {
    return {.address = address_of(where.host), .port = static_cast<std::uint16_t>(where.port)};
}

} // namespace

// Every other incarnation sends from the same port as the one before.
group_port::group_port(network& net, node_run& process)
    : net_(net),
      process_(std::static_pointer_cast<node_run>(process.shared_from_this())), local_{process.host(),
                                                                                       first_port +
                                                                                           process.run_number() / 2},
      name_(to_string(local_)), source_(source_of(local_)) {}

void group_port::start(core::group_listener& owner) {
    owner_ = &owner;
    net_.join(shared_from_this());
}

void group_port::close() {
    owner_ = nullptr;
    waiting_.clear();
    unsent_ = 0;
}

// -- sending ---------------------------------------------------------------------------------------------------------

core::datagrams_done group_port::send(core::datagram_list all) {
    if (owner_ == nullptr) {
        return {.bytes = all.bytes().size()};
    }
    core::datagrams_done taken;
    for (; !all.empty() && put(all.first()); all.drop_first()) {
        ++taken.count;
        taken.bytes += all.first().size();
    }
    return taken;
}

void group_port::send_to(const core::group_source& to, std::string_view datagram) {
    if (owner_ != nullptr) {
        net_.send(local_, {to.address - address_of(0), to.port}, datagram);
    }
}

// What a planted fault loses.
bool group_port::is_swallowed(std::string_view line) {
    constexpr std::uint64_t enough = 10;
    switch (net_.fault()) {
    case planted::announcements_end:
        return local_.host == 1 && is_announcement(line) && !is_farewell(line) && ++announcements_ > enough;
    case planted::repeat_swallowed:
        return line.starts_with("UPDATE ") && line.find(":beacon ") != std::string_view::npos;
    case planted::lease_lapses:
        return line.starts_with("BIND ") && !line.ends_with(":cles\n") && !bound_.emplace(line).second;
    default: return false;
    }
}

// False if the limit on pending output is reached.
bool group_port::put(std::string_view line) {
    if (silent_ || is_swallowed(line)) {
        return true;
    }
    const bool twice =
        net_.fault() == planted::group_sends_twice && line.starts_with("UPDATE ") && !is_announcement(line);
    for (int times = twice ? 2 : 1; times != 0; --times) {
        if (waiting_.empty() && in_system_ < system_capacity) {
            pass_on(line);
        } else if (unsent_ + line.size() > max_waiting) {
            return false;
        } else {
            unsent_ += line.size();
            waiting_.emplace_back(line);
        }
        if (!net_.secured()) {
            report_sent(line);
        }
    }
    return true;
}

void group_port::report_sent(std::string_view line) {
    if (const auto process = process_.lock()) {
        process->judges().each(&part::on_group_sent, *process, line);
    }
}

void group_port::pass_on(std::string_view line) {
    const auto process = process_.lock();
    if (owner_ == nullptr || !process) {
        return;
    }
    net_.watcher().saw(name_, "==>", net_.secured() ? "a sealed datagram" : line);
    net_.multicast(local_, line);
    if (in_system_++ == 0) {
        process->later(until_writable, if_alive(weak_from_this(), [](group_port& self) { self.drain(); }));
    }
}

void group_port::drain() {
    in_system_ = 0;
    const bool waited = !waiting_.empty();
    while (!waiting_.empty() && in_system_ < system_capacity) {
        const auto line = std::move(waiting_.front());
        waiting_.pop_front();
        unsent_ -= line.size();
        pass_on(line);
    }
    if (waited && waiting_.empty() && owner_ != nullptr) {
        owner_->on_writable();
    }
}

// -- receiving -------------------------------------------------------------------------------------------------------

void group_port::receive(const endpoint& from, const std::string& datagram, bool to_group) {
    if (const auto process = process_.lock()) {
        process->receive([weak = weak_from_this(), from, datagram, to_group] {
            if (const auto self = weak.lock(); self && self->owner_ != nullptr) {
                self->hand_over(from, datagram, to_group);
            }
        });
    }
}

void group_port::report_received(const core::group_source& from, std::string_view line) {
    const auto process = process_.lock();
    net_.watcher().saw(process->name(), "<==", line);
    process->judges().each(&part::on_group_heard, *process, from, line);
}

void group_port::report_accepted(std::string_view member, std::string_view line) {
    const auto process = process_.lock();
    process->judges().each(&part::on_group_accepted, *process, member, line);
}

void group_port::hand_over(const endpoint& from, const std::string& datagram, bool to_group) {
    const auto sender = source_of(from);
    if (net_.secured()) {
        owner_->on_datagram({.from = sender, .text = datagram, .request = nullptr, .to_group = to_group});
        return;
    }
    report_received(sender, datagram);
    if (net_.fault() == planted::farewell_unheard && is_farewell(datagram)) {
        return;
    }
    protocol::request_line read;
    const bool good = protocol::parse_group_message(datagram, read);
    owner_->on_datagram({sender, datagram, good ? &read : nullptr});
}

} // namespace cles::simulation
