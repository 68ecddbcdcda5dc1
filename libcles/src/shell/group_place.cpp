// SPDX-License-Identifier: BSL-1.0
#include "shell/group_place.hpp"

#include "protocol/datagram.hpp"
#include "shell/local_node.hpp"

#include <algorithm>

namespace cles::shell {
group_place::group_place(local_node& host, core::group_intake& intake, const core::network_interface& by,
                         const multicast_options& where)
    : host_(host), port_(host.environment().join(by, where)),
      session_(host.shared_node(), intake, port_->source(), *this, host.environment().random()) {}

group_place::~group_place() { port_->close(); }

void group_place::start() { port_->start(*this); }

void group_place::stop() {
    session_.unbind_all();
    port_->close();
}

bool group_place::send(std::string_view line) {
    if (line.size() > protocol::datagram_bytes) {
        ++host_.node().counts.group_unsent;
        return false;
    }
    return put(line);
}

void group_place::send_all(std::string_view lines) { put(lines); }

// True where all of it has been sent, or waits for room.
bool group_place::put(std::string_view lines) {
    auto& counts = host_.node().counts;
    const auto taken = port_->send(lines);
    counts.group_sent += taken.lines;
    const auto left = lines.substr(taken.bytes);
    counts.group_unsent += static_cast<std::uint64_t>(std::ranges::count(left, '\n'));
    return left.empty();
}

void group_place::on_datagram(const core::group_datagram& datagram) {
    const auto keep = host_.shared_from_this();
    session_.on_message(datagram.from, datagram.request, host_.now());
    keep->completions().rethrow();
}

void group_place::on_batch() { host_.settle(); }

void group_place::on_room() {
    const auto keep = host_.shared_from_this();
    session_.bindings().drain(host_.now());
    host_.settle();
}

} // namespace cles::shell
