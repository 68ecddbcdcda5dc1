// SPDX-License-Identifier: BSL-1.0
// What is read from the system about interfaces: no report is missed, and nothing is read beyond the end.
#include "transport/netlink_message.hpp"

#include "fuzz/fuzz.hpp"

#include <cstddef>
#include <cstring>
#include <vector>

namespace cles::fuzz {

void run(std::string_view input) {
    std::vector<std::byte> exact(input.size()); // so that a sanitizer notices a read beyond it
    if (!input.empty()) {
        std::memcpy(exact.data(), input.data(), input.size());
    }
    const bool reports = transport::may_report_interface(exact);

    // Behind what is no report, a report is found, unless it is part of a message.
    constexpr auto alignment = transport::netlink_alignment;
    const transport::netlink_head link{.length = sizeof link, .type = transport::netlink_type::new_link};
    exact.resize((exact.size() + alignment - 1) / alignment * alignment + sizeof link);
    std::memcpy(exact.data() + exact.size() - sizeof link, &link, sizeof link);
    require(reports || transport::may_report_interface(exact), "a report behind others is found", input);
    require(!transport::may_report_interface({}), "nothing is no report");
}

} // namespace cles::fuzz
