// SPDX-License-Identifier: BSL-1.0
#include "shell/listeners.hpp"

#include "shell/local_node.hpp"

#include <cstdint>
#include <utility>

namespace cles::shell {

void listeners::start(acceptor& made, bool counted) {
    made.start([weak = host_.weak_from_this(), counted](link_ptr arrived) {
        if (const auto host = weak.lock()) {
            host->connections().on_accepted(std::move(arrived), counted);
        } else {
            arrived->close();
        }
    });
}

std::string listeners::listen(std::string_view where, bool insecure) {
    const auto address = parse_url(where);
    auto& environment = host_.environment();
    if (!environment.has_transport(address.scheme)) {
        throw error(errc::unknown_scheme, "'" + address.scheme + "' in '" + std::string{where} + "'");
    }
    if (!insecure && environment.is_exposed(address)) {
        throw error(errc::insecure_listen, "'" + std::string{where} +
                                               "' can be reached from other hosts, and nobody proves who they are; "
                                               "say 'insecure' if that is meant");
    }
    std::unique_ptr<acceptor> made;
    try {
        made = environment.listen(address, host_.bounds());
    } catch (const boost::system::system_error& e) {
        throw error(e.code(), "cannot listen on '" + std::string{where} + "': " + e.code().message());
    }
    start(*made, true);
    auto local = to_string(made->local());
    open_.push_back(std::move(made));
    return local;
}

std::string listeners::self_door() const { return "self/" + std::to_string(reinterpret_cast<std::uintptr_t>(&host_)); }

std::string listeners::shared_door(std::string_view name) const {
    return host_.environment().local_scope() + "/" + std::string{name};
}

void listeners::open_local_doors() {
    for (const auto& door : {self_door(), shared_door(host_.node().name)}) {
        try {
            auto made =
                host_.environment().listen({.scheme = "inproc", .host = door, .port = 0, .path = {}}, host_.bounds());
            start(*made, false);
            doors_.push_back(std::move(made));
        } catch (const boost::system::system_error&) {
            host_.say(log_level::warning,
                      "another '" + host_.node().name + "' in this process is the one that others find here");
        }
    }
}

void listeners::close() {
    open_.clear();
    doors_.clear();
}

void listeners::turn_away() {
    for (const auto& each : open_) {
        each->accept_waiting();
    }
    std::erase_if(open_, [](const auto& each) { return each->local().scheme != "udp"; });
}

} // namespace cles::shell
