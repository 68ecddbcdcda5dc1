// SPDX-License-Identifier: BSL-1.0
#include "network.hpp"

#include "fields.hpp"

namespace sysinfo {
namespace {

constexpr std::size_t most_interfaces = 256;

traffic next_traffic(fields& f) {
    traffic out;
    out.bytes = f.number<std::uint64_t>();
    out.packets = f.number<std::uint64_t>();
    out.errors = f.number<std::uint64_t>();
    out.dropped = f.number<std::uint64_t>();
    return out;
}

} // namespace

// Two lines of headings; then  eth0: 1234 12 0 0 0 0 0 0  4321 21 0 0 0 0 0 0
network parse_network(std::string_view net_dev) {
    network out;
    std::string_view line;
    while (next_line(net_dev, line) && out.interfaces.size() < most_interfaces) {
        const auto colon = line.rfind(':'); // an alias has one in its name
        if (colon == std::string_view::npos) {
            continue;
        }
        interface_traffic entry;
        entry.name = fields{line.substr(0, colon)}.next();
        fields f{line.substr(colon + 1)};
        entry.received = next_traffic(f);
        f.skip(4);
        entry.sent = next_traffic(f);
        out.interfaces.push_back(std::move(entry));
    }
    return out;
}

} // namespace sysinfo
