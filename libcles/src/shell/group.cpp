// SPDX-License-Identifier: BSL-1.0
#include "shell/group.hpp"

#include "shell/engine.hpp"

#include <boost/asio/error.hpp>

#include <random>
#include <utility>
#include <vector>

namespace cles::shell {
namespace {

std::string cannot(const multicast_options& where, const std::string& interface) {
    return "cannot join " + where.group + ":" + std::to_string(where.port) + " on '" + interface + "': ";
}

error cannot_join(const multicast_options& where, const std::string& interface, const boost::system::error_code& why) {
    const auto reason = why == boost::system::errc::address_not_available ? "it has no IPv4 address"
                        : why == boost::asio::error::network_down         ? "it is down"
                                                                          : why.message();
    return {why, cannot(where, interface) + reason};
}

std::vector<transport::ip_interface> interfaces_here(const multicast_options& where) {
    try {
        return transport::interfaces_of_host();
    } catch (const boost::system::system_error& e) {
        throw cannot_join(where, where.interface, e.code());
    }
}

} // namespace

group::group(detail::engine& host, const multicast_options& where, bool insecure)
    : engine_(host), intake_(host.node(), *this, std::random_device{}()) {
    check(where);
    if (where.interface == "auto") {
        join_automatic(where, insecure);
    } else {
        join_all(where, insecure);
    }
}

void group::join(const transport::ip_interface& by, const multicast_options& where, bool insecure) {
    if (!by.loopback && !insecure) {
        throw error(errc::insecure_listen, "multicast on '" + by.name +
                                               "' can be reached from other hosts, and nobody proves who they "
                                               "are; say 'insecure' if that is meant");
    }
    const auto& place = places_.emplace_back(engine_, intake_, by, where);
    interfaces_ += (interfaces_.empty() ? "" : ", ") + by.name;
    const auto& to = place.port().group();
    engine_.say(log_level::info, engine_.node().name + " takes part in " + to.address().to_string() + ":" +
                                     std::to_string(to.port()) + " on " + by.name + ", sending from " +
                                     to_text(place.source()));
}

// Where not all are required, one is enough.
void group::join_all(const multicast_options& where, bool insecure) {
    std::vector<error> failures;
    for (const auto& name : interfaces_of(where)) {
        try {
            join(transport::find_interface(name), where, insecure);
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
        engine_.say(log_level::warning, e.message());
    }
}

// What cannot be joined was not asked for by name.
void group::join_automatic(const multicast_options& where, bool insecure) {
    std::string left_out;
    boost::system::error_code failure = boost::asio::error::network_down;
    for (const auto& by : transport::automatic(interfaces_here(where))) {
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
            engine_.say(log_level::warning, refused.message());
        } catch (const boost::system::system_error& e) {
            failure = e.code();
            engine_.say(log_level::warning, cannot_join(where, by.name, failure).message());
        }
    }
    if (places_.empty()) {
        throw error(failure, cannot(where, where.interface) + "no interface of this host can be used");
    }
    if (!left_out.empty()) {
        engine_.say(log_level::warning, "multicast on 'auto' takes " + interfaces_ + ", and leaves out " + left_out);
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
            engine_.completions().put(core::completion{
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
