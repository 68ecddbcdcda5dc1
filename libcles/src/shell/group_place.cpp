// SPDX-License-Identifier: BSL-1.0
#include "shell/group_place.hpp"

#include "protocol/datagram.hpp"
#include "shell/engine.hpp"

#include <algorithm>
#include <cstdint>
#include <random>

namespace cles::shell {
namespace {

core::group_source source_of(const boost::asio::ip::udp::endpoint& end) {
    return {.address = end.address().to_v4().to_uint(), .port = end.port()};
}

} // namespace

group_place::group_place(detail::engine& host, core::group_intake& intake, const transport::ip_interface& by,
                         const multicast_options& where)
    : engine_(host), port_(std::make_shared<transport::group_port>(host.executor(), by, where)),
      source_(source_of(port_->source())),
      session_(host.shared_node(), intake, source_, *this, std::random_device{}()) {}

group_place::~group_place() { port_->close(); }

void group_place::start() { port_->start(*this); }

void group_place::stop() {
    session_.unbind_all();
    port_->close();
}

bool group_place::send(std::string_view line) {
    if (line.size() > protocol::datagram_bytes) {
        ++engine_.node().counts.group_unsent;
        return false;
    }
    return put(line);
}

void group_place::send_all(std::string_view lines) { put(lines); }

// True where all of it has been sent, or waits for room.
bool group_place::put(std::string_view lines) {
    auto& counts = engine_.node().counts;
    const auto taken = port_->send(lines);
    counts.group_sent += taken.lines;
    const auto left = lines.substr(taken.bytes);
    counts.group_unsent += static_cast<std::uint64_t>(std::ranges::count(left, '\n'));
    return left.empty();
}

void group_place::on_datagram(const transport::group_datagram& datagram) {
    const auto keep = engine_.shared_from_this();
    session_.on_message(source_of(datagram.from), datagram.said, engine_.now());
    keep->completions().rethrow();
}

void group_place::on_batch() { engine_.settle(); }

void group_place::on_room() {
    const auto keep = engine_.shared_from_this();
    session_.bindings().drain(engine_.now());
    engine_.settle();
}

} // namespace cles::shell
