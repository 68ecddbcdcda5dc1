// SPDX-License-Identifier: BSL-1.0
#include "shell/group.hpp"

#include "shell/local_node.hpp"

#include <boost/system/errc.hpp>

#include <cerrno>
#include <utility>
#include <vector>

namespace cles::shell {
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

std::vector<core::network_interface> interfaces_here(core::environment& by, const multicast_options& where) {
    try {
        return by.interfaces();
    } catch (const boost::system::system_error& e) {
        throw cannot_join(where, where.interface, e.code());
    }
}

} // namespace

group::group(local_node& host, const multicast_options& where, bool insecure)
    : host_(host), intake_(host.node(), *this, host.environment().random()) {
    check(where);
    if (where.interface == "auto") {
        join_automatic(where, insecure);
    } else {
        join_all(where, insecure);
    }
}

void group::join(const core::network_interface& by, const multicast_options& where, bool insecure) {
    if (!by.loopback && !insecure) {
        throw error(errc::insecure_listen, "multicast on '" + by.name +
                                               "' can be reached from other hosts, and nobody proves who they "
                                               "are; say 'insecure' if that is meant");
    }
    const auto& place = places_.emplace_back(host_, intake_, by, where);
    interfaces_ += (interfaces_.empty() ? "" : ", ") + by.name;
    host_.say(log_level::info, host_.node().name + " takes part in " + where.group + ":" + std::to_string(where.port) +
                                   " on " + by.name + ", sending from " + to_text(place.source()));
}

// Where not all are required, one is enough.
void group::join_all(const multicast_options& where, bool insecure) {
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
    if (places_.empty()) {
        throw error{failures.front()};
    }
    for (const auto& e : failures) {
        host_.say(log_level::warning, e.message());
    }
}

// What cannot be joined was not asked for by name.
void group::join_automatic(const multicast_options& where, bool insecure) {
    std::string left_out;
    auto failure = boost::system::error_code{ENETDOWN, boost::system::system_category()};
    for (const auto& by : core::automatic(interfaces_here(host_.environment(), where))) {
        if (places_.size() == multicast_options::most_interfaces) {
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
            host_.say(log_level::warning, refused.message());
        } catch (const boost::system::system_error& e) {
            failure = e.code();
            host_.say(log_level::warning, cannot_join(where, by.name, failure).message());
        }
    }
    if (places_.empty()) {
        throw error(failure, cannot(where, where.interface) + "no interface of this host can be used");
    }
    if (!left_out.empty()) {
        host_.say(log_level::warning, "multicast on 'auto' takes " + interfaces_ + ", and leaves out " + left_out);
    }
}

void group::start() {
    for (auto& each : places_) {
        each.start();
    }
}

void group::stop() {
    for (auto* feed : intake_.feeds().remove_all()) {
        if (auto waiting = feed->mail().close()) {
            host_.completions().put(core::completion{
                core::completion::event_failure{std::move(waiting), errc::stopped, "the service has been stopped"}});
        }
    }
    for (auto& each : places_) {
        each.stop();
    }
}

bool group::send(std::string_view line) {
    bool sent = false;
    for (auto& each : places_) {
        sent = each.send(line) || sent;
    }
    return sent;
}

} // namespace cles::shell
