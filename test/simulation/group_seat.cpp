// SPDX-License-Identifier: BSL-1.0
#include "simulation/group_seat.hpp"

#include "core/announcement.hpp"
#include "protocol/datagram.hpp"
#include "simulation/node_run.hpp"
#include "support/hear.hpp"

#include <array>
#include <utility>

namespace cles::simulation {
namespace {

std::string_view name_of(core::presence::change what) noexcept {
    constexpr std::array<std::string_view, 8> names{"finds",        "finds elsewhere", "hears nothing of",
                                                    "hears again",  "sees leaving",    "gives up",
                                                    "hears two of", "gives way to"};
    return names[static_cast<std::size_t>(what)];
}

} // namespace

group_seat::group_seat(node_run& host, std::shared_ptr<group_port> port, group_watch& judge, std::uint32_t seed)
    : node_(host), port_(std::move(port)), judge_(judge), intake_(*host.node(), *this, ~seed),
      session_(host.node(), intake_, port_->source(), *this, seed),
      announcer_(*this, host.node()->deadlines, seed * 3 + 1), round_(*this, host.node()->deadlines) {
    intake_.attend(this);
    host.node()->others.watch(this);
}

group_seat::~group_seat() {
    port_->close();
    node_.node()->others.watch(nullptr);
}

void group_seat::start() {
    port_->open(*this);
    round_.expect();
    send("BIND all:cles\n");
    round_.begin(node_.now());
    announcer_.start(node_.now());
}

void group_seat::leave() {
    announcer_.stop();
    round_.stop();
    if (seq_ != 0) {
        say(core::announcer::shortest, true);
    }
    intake_.attend(nullptr);
    static_cast<void>(intake_.feeds().remove_all());
    session_.unbind_all();
    port_->close();
}

void group_seat::ask_for(std::string_view node) { send("BIND " + std::string{node} + ":cles\n"); }

// -- what this node says -------------------------------------------------------------------------------------------

bool group_seat::send(std::string_view line) {
    auto& counts = node_.node()->counts;
    if (is_swallowed(line)) {
        return true;
    }
    const bool update = line.starts_with("UPDATE ") && line.find(":cles ") == std::string_view::npos;
    const int times = update && node_.fault() == planted::group_sends_twice ? 2 : 1;
    for (int i = 0; i < times; ++i) {
        judge_.on_group_sent(node_, line);
        if (line.size() > protocol::datagram_bytes || !port_->send(line)) {
            ++counts.group_unsent;
            return false;
        }
        ++counts.group_sent;
    }
    return true;
}

// What a planted fault keeps back.
bool group_seat::is_swallowed(std::string_view line) {
    if (node_.fault() == planted::repeat_swallowed) {
        return line.starts_with("UPDATE ") && line.find(":beacon ") != std::string_view::npos;
    }
    if (node_.fault() == planted::lease_lapses && line.starts_with("BIND ") && !line.ends_with(":cles\n")) {
        return !bound_.emplace(line).second;
    }
    return false;
}

bool group_seat::has_room() const { return port_->unsent() == 0; }

void group_seat::announce(std::chrono::milliseconds interval) {
    constexpr std::uint64_t enough = 10;
    if (node_.fault() != planted::announcements_end || node_.host() != 1 || seq_ < enough) {
        say(interval, false);
    }
}

void group_seat::say(std::chrono::milliseconds interval, bool leaving) {
    auto& node = *node_.node();
    std::string tasks;
    json_writer w{tasks};
    write_tasks(w, node);
    const core::announcement said{
        .node = node.name,
        .endpoints = {"tcp://0.0.0.0:" + std::to_string(stream_door), "udp://0.0.0.0:" + std::to_string(datagram_door)},
        .load = node.load_now(),
        .interval = interval,
        .tasks = core::digest_of_tasks(tasks),
        .leaving = leaving};
    std::string line;
    append_announcement(line, said, ++seq_, node.epoch);
    if (send(line)) {
        ++node.counts.announcements_sent;
    }
}

std::size_t group_seat::others() const { return node_.node()->others.size(); }

// -- what others say -----------------------------------------------------------------------------------------------

void group_seat::on_datagram(const core::group_source& from, std::string_view datagram) {
    node_.watcher().saw(node_.name(), "<==", datagram);
    judge_.on_group_heard(node_, from, datagram);
    test::hear(session_, from, datagram, node_.now());
}

void group_seat::on_room() { session_.bindings().drain(node_.now()); }

void group_seat::on_solicitation(bool by_name, time_point now) {
    if (by_name) {
        announcer_.hurry(now);
    } else {
        announcer_.solicited(now);
    }
}

void group_seat::on_announcement(const core::group_source& from, const protocol::request_line& update, time_point now) {
    core::announcement said;
    std::string why;
    if (!read_announcement(update, said, why)) {
        node_.watcher().broken(rule::well_formed, node_.name() + " cannot read an announcement: " + why);
        return;
    }
    if (!said.leaving || node_.fault() != planted::farewell_unheard) {
        node_.node()->others.hear(said, *update.epoch, *update.seq, from, now);
    }
}

void group_seat::on_peer(std::string_view node, core::presence::change what, std::string_view) {
    node_.watcher().saw(node_.name(), name_of(what), node);
    if (what != core::presence::change::clash || node_.fault() != planted::clash_kept) {
        judge_.on_neighbour(node_, node, what);
    }
}

} // namespace cles::simulation
