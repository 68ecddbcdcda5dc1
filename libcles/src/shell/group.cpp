// SPDX-License-Identifier: BSL-1.0
#include "shell/group.hpp"

#include "protocol/datagram.hpp"
#include "shell/engine.hpp"

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <utility>

namespace cles::shell {
namespace {

core::group_source source_of(const boost::asio::ip::udp::endpoint& end) {
    return {.address = end.address().to_v4().to_uint(), .port = end.port()};
}

std::string text_of(const boost::asio::ip::udp::endpoint& end) {
    return end.address().to_string() + ":" + std::to_string(end.port());
}

std::shared_ptr<transport::group_port> join(detail::engine& host, const multicast_options& where, bool insecure) {
    check(where);
    const auto cannot =
        "cannot join " + where.group + ":" + std::to_string(where.port) + " on '" + where.interface + "': ";
    try {
        const auto by = transport::find_interface(where.interface);
        if (!by.loopback && !insecure) {
            throw error(errc::insecure_listen, "multicast on '" + where.interface +
                                                   "' can be reached from other hosts, and nobody proves who they "
                                                   "are; say 'insecure' if that is meant");
        }
        auto made = std::make_shared<transport::group_port>(host.executor(), by, where);
        host.say(log_level::info, host.node().name + " takes part in " + text_of(made->group()) + " on " +
                                      where.interface + ", sending from " + text_of(made->source()));
        return made;
    } catch (const error&) {
        throw;
    } catch (const boost::system::system_error& e) {
        throw error(e.code(), cannot + e.code().message());
    }
}

} // namespace

group::group(detail::engine& host, const multicast_options& where, bool insecure)
    : engine_(host), port_(join(host, where, insecure)), source_(source_of(port_->source())),
      session_(host.shared_node(), source_, *this, std::random_device{}()) {}

group::~group() { port_->close(); }

void group::start() { port_->start(*this); }

void group::stop() {
    for (auto* feed : session_.feeds().remove_all()) {
        if (auto waiting = feed->mail().close()) {
            engine_.completions().put(core::completion{
                core::completion::event_failure{std::move(waiting), errc::stopped, "the service has been stopped"}});
        }
    }
    session_.unbind_all();
    port_->close();
}

bool group::send(std::string_view line) {
    if (line.size() > protocol::datagram_bytes) {
        ++engine_.node().counts.group_unsent;
        return false;
    }
    return put(line);
}

void group::send_all(std::string_view lines) { put(lines); }

// True where all of it has been sent, or waits for room.
bool group::put(std::string_view lines) {
    auto& counts = engine_.node().counts;
    const auto taken = port_->send(lines);
    counts.group_sent += taken.lines;
    const auto left = lines.substr(taken.bytes);
    counts.group_unsent += static_cast<std::uint64_t>(std::ranges::count(left, '\n'));
    return left.empty();
}

void group::on_datagram(const transport::group_datagram& datagram) {
    const auto keep = engine_.shared_from_this();
    session_.on_message(source_of(datagram.from), datagram.said, engine_.now());
    keep->completions().rethrow();
}

void group::on_batch() { engine_.settle(); }

void group::on_room() {
    const auto keep = engine_.shared_from_this();
    session_.bindings().drain(engine_.now());
    engine_.settle();
}

} // namespace cles::shell
