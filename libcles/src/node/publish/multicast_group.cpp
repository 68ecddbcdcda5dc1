// SPDX-License-Identifier: BSL-1.0
#include "node/publish/multicast_group.hpp"

#include "node/local_node.hpp"
#include "protocol/datagram.hpp"

#include <boost/system/errc.hpp>

#include <algorithm>
#include <cerrno>
#include <utility>
#include <vector>

namespace cles::core {
namespace {

std::string cannot(const multicast_options& where, const std::string& interface) {
    return "cannot join " + where.group + ":" + std::to_string(where.port) + " on '" + interface + "': ";
}

error cannot_join(const multicast_options& where, const std::string& interface, const boost::system::error_code& why) {
    const auto reason = why == boost::system::errc::address_not_available ? "it has no IPv4 address"
                        : why == boost::system::errc::network_down        ? "it is down"
                                                                          : why.message();
    return {why, cannot(where, interface) + reason};
}

std::vector<core::network_interface> interfaces_or_throw(core::environment& by, const multicast_options& where) {
    try {
        return by.interfaces();
    } catch (const boost::system::system_error& e) {
        throw cannot_join(where, where.interface, e.code());
    }
}

} // namespace

multicast_group::multicast_group(local_node& host, const multicast_options& where, bool insecure)
    : host_(host), dispatcher_(host.node(), *this, host.environment().random()) {
    check(where);
    if (where.interface == "auto") {
        join_automatic(where, insecure);
    } else {
        join_all(where, insecure);
    }
}

void multicast_group::join(const core::network_interface& by, const multicast_options& where, bool insecure) {
    if (!by.loopback && !insecure) {
        throw error(errc::insecure_listen, "multicast on '" + by.name +
                                               "' can be reached from other hosts, and nobody proves who they "
                                               "are; say 'insecure' if that is meant");
    }
    const auto& place = endpoints_.emplace_back(host_, dispatcher_, by, where);
    interfaces_ += (interfaces_.empty() ? "" : ", ") + by.name;
    host_.write_log(log_level::info, host_.node().name + " takes part in " + where.group + ":" +
                                         std::to_string(where.port) + " on " + by.name + ", sending from " +
                                         to_text(place.source()));
}

// One interface is enough unless all are required.
void multicast_group::join_all(const multicast_options& where, bool insecure) {
    std::vector<error> failures;
    for (const auto& name : interfaces_of(where)) {
        try {
            join(host_.environment().find_interface(name), where, insecure);
        } catch (const error& refused) {
            failures.push_back(refused);
        } catch (const boost::system::system_error& e) {
            failures.push_back(cannot_join(where, name, e.code()));
        }
        if (!failures.empty() && where.required) {
            throw error{failures.front()};
        }
    }
    if (endpoints_.empty()) {
        throw error{failures.front()};
    }
    for (const auto& e : failures) {
        host_.write_log(log_level::warning, e.message());
    }
}

// An interface that cannot be joined was not requested by name.
void multicast_group::join_automatic(const multicast_options& where, bool insecure) {
    std::string left_out;
    auto failure = boost::system::error_code{ENETDOWN, boost::system::system_category()};
    for (const auto& by : core::automatic(interfaces_or_throw(host_.environment(), where))) {
        if (endpoints_.size() == multicast_options::most_interfaces) {
            left_out += (left_out.empty() ? "" : ", ") + by.name;
            continue;
        }
        try {
            join(by, where, insecure);
        } catch (const error& refused) {
            if (where.required) {
                throw;
            }
            failure = refused.code();
            host_.write_log(log_level::warning, refused.message());
        } catch (const boost::system::system_error& e) {
            failure = e.code();
            host_.write_log(log_level::warning, cannot_join(where, by.name, failure).message());
        }
    }
    if (endpoints_.empty()) {
        throw error(failure, cannot(where, where.interface) + "no interface of this host can be used");
    }
    if (!left_out.empty()) {
        host_.write_log(log_level::warning,
                        "multicast on 'auto' takes " + interfaces_ + ", and leaves out " + left_out);
    }
}

void multicast_group::start() {
    for (auto& each : endpoints_) {
        each.start();
    }
}

void multicast_group::stop() {
    for (auto* feed : dispatcher_.feeds().remove_all()) {
        if (auto waiting = feed->mail().close()) {
            host_.completions().put(core::completion{
                core::completion::event_failure{std::move(waiting), errc::stopped, "the service has been stopped"}});
        }
    }
    for (auto& each : endpoints_) {
        each.stop();
    }
}

bool multicast_group::send(std::string_view line) {
    bool sent = false;
    for (auto& each : endpoints_) {
        sent = each.send(line) || sent;
    }
    return sent;
}

group_endpoint::group_endpoint(local_node& host, core::group_dispatcher& dispatcher, const core::network_interface& by,
                               const multicast_options& where)
    : host_(host), port_(host.environment().join(by, where)),
      session_(host.shared_node(), dispatcher, port_->source(), *this, host.environment().random()) {}

group_endpoint::~group_endpoint() { port_->close(); }

void group_endpoint::start() { port_->start(*this); }

void group_endpoint::stop() {
    session_.unbind_all();
    port_->close();
}

bool group_endpoint::send(std::string_view line) {
    if (line.size() > protocol::datagram_bytes) {
        ++host_.node().counts.group_unsent;
        return false;
    }
    return put(line);
}

void group_endpoint::send_all(std::string_view lines) { put(lines); }

// Returns true if everything has been sent or waits for room.
bool group_endpoint::put(std::string_view lines) {
    auto& counts = host_.node().counts;
    const auto taken = port_->send(lines);
    counts.group_sent += taken.lines;
    const auto left = lines.substr(taken.bytes);
    counts.group_unsent += static_cast<std::uint64_t>(std::ranges::count(left, '\n'));
    return left.empty();
}

void group_endpoint::on_datagram(const core::group_datagram& datagram) {
    const auto keep = host_.shared_from_this();
    session_.on_message(datagram.from, datagram.request, host_.now());
    keep->completions().rethrow();
}

void group_endpoint::on_room() {
    const auto keep = host_.shared_from_this();
    session_.bindings().drain(host_.now());
}

} // namespace cles::core
