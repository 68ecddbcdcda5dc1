// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/multicast.hpp>

#include <boost/asio/ip/address_v4.hpp>

#include <charconv>

namespace cles {
namespace {

std::uint16_t port_of(std::string_view digits, std::string_view whole) {
    std::uint16_t port = 0;
    const auto* end = digits.data() + digits.size();
    const auto [rest, code] = std::from_chars(digits.data(), end, port);
    if (code != std::errc{} || rest != end || port == 0) {
        throw error(errc::invalid_url,
                    "'" + std::string{digits} + "' in '" + std::string{whole} + "' is no port from 1 to 65535");
    }
    return port;
}

} // namespace

multicast_options parse_multicast(std::string_view text) {
    multicast_options where;
    if (text == "off") {
        return where;
    }
    const auto comma = text.find(',');
    where.interface = text.substr(0, comma);
    if (where.interface.empty()) {
        throw error(errc::invalid_url,
                    "'" + std::string{text} + "' names no interface: INTERFACE, INTERFACE,GROUP:PORT, or off");
    }
    if (comma != std::string_view::npos) {
        const auto group = text.substr(comma + 1);
        const auto colon = group.find(':');
        where.group = group.substr(0, colon);
        check(where);
        if (colon != std::string_view::npos) {
            where.port = port_of(group.substr(colon + 1), text);
        }
    }
    return where;
}

void check(const multicast_options& where) {
    boost::system::error_code code;
    const auto group = boost::asio::ip::make_address_v4(where.group, code);
    if (code || !group.is_multicast()) {
        throw error(errc::invalid_url,
                    "'" + where.group + "' is not an IPv4 multicast group (224.0.0.0 to 239.255.255.255)");
    }
    if (where.port == 0) {
        throw error(errc::invalid_url, "port 0 cannot be a multicast group's: the others would not know it");
    }
}

} // namespace cles
