// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/multicast.hpp>

#include "json/json_scan.hpp"
#include "transport/ip_interface.hpp"

#include <boost/asio/ip/address_v4.hpp>

#include <algorithm>

namespace cles {
namespace {

std::uint16_t port_of(std::string_view digits, std::string_view whole) {
    std::uint16_t port = 0;
    if (!json_detail::read_number(digits, port) || port == 0) {
        throw error(errc::invalid_url,
                    "'" + std::string{digits} + "' in '" + std::string{whole} + "' is not a port from 1 to 65535");
    }
    return port;
}

std::vector<std::string> parts_of(std::string_view list) {
    std::vector<std::string> parts;
    for (;;) {
        const auto comma = list.find(',');
        parts.emplace_back(list.substr(0, comma));
        if (comma == std::string_view::npos) {
            return parts;
        }
        list.remove_prefix(comma + 1);
    }
}

bool is_group(std::string_view part) noexcept {
    return !part.empty() && (json_detail::is_digit(part.front()) || part.find(':') != std::string_view::npos);
}

void check_interfaces(const std::string& list) {
    const auto refuse = [&](const std::string& why) { throw error(errc::invalid_url, "'" + list + "' " + why); };
    const auto names = parts_of(list);
    for (auto name = names.begin(); name != names.end(); ++name) {
        if (name->empty()) {
            refuse("has an empty name of an interface");
        }
        if (names.size() > 1 && (*name == "auto" || *name == "off")) {
            refuse("combines '" + *name + "' with other names");
        }
        if (std::find(names.begin(), name, *name) != name) {
            refuse("names '" + *name + "' twice");
        }
    }
    if (names.size() > multicast_options::most_interfaces) {
        refuse("names " + std::to_string(names.size()) + " interfaces: at most " +
               std::to_string(multicast_options::most_interfaces) + " are allowed");
    }
}

} // namespace

multicast_options parse_multicast(std::string_view text) {
    multicast_options where;
    if (text == "off") {
        return where;
    }
    if (text.empty() || text.front() == ',') {
        throw error(errc::invalid_url,
                    "'" + std::string{text} +
                        "' does not begin with an interface: INTERFACE[,INTERFACE...][,GROUP[:PORT]], auto, or off");
    }
    const auto last = text.rfind(',');
    const bool has_group = last != std::string_view::npos && is_group(text.substr(last + 1));
    where.interface = text.substr(0, has_group ? last : text.size());
    std::string_view port;
    if (has_group) {
        const auto group = text.substr(last + 1);
        const auto colon = group.find(':');
        where.group = group.substr(0, colon);
        port = colon == std::string_view::npos ? port : group.substr(colon);
    }
    check(where);
    if (!port.empty()) {
        where.port = port_of(port.substr(1), text);
    }
    return where;
}

void check(const multicast_options& where) {
    if (where.is_on()) {
        check_interfaces(where.interface);
    }
    boost::system::error_code code;
    const auto group = boost::asio::ip::make_address_v4(where.group, code);
    if (code || !group.is_multicast()) {
        throw error(errc::invalid_url,
                    "'" + where.group + "' is not an IPv4 multicast group (224.0.0.0 to 239.255.255.255)");
    }
    if (where.port == 0) {
        throw error(errc::invalid_url, "a multicast group's port must not be 0, which other nodes could not know");
    }
}

std::vector<std::string> interfaces_of(const multicast_options& where) {
    if (!where.is_on()) {
        return {};
    }
    if (where.interface != "auto") {
        return parts_of(where.interface);
    }
    std::vector<std::string> names;
    try {
        for (auto& each : core::automatic(transport::interfaces_of_host())) {
            if (names.size() < multicast_options::most_interfaces) {
                names.push_back(std::move(each.name));
            }
        }
    } catch (const boost::system::system_error&) { // unknown
    }
    return names;
}

} // namespace cles
