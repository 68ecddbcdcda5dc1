// SPDX-License-Identifier: BSL-1.0
#include "bench_bytes_report.hpp"

#include "bench_table.hpp"

namespace tool {

std::string table_of(const bytes_report& report) {
    rows out{{"localization", "struct", "CLES tcp", "CLES udp", "struct tcp frame", "CLES tcp frame", "ratio",
              "struct udp frame", "CLES udp frame", "ratio udp"}};
    for (const auto& row : report.rows) {
        out.add({row.message, fixed(row.icd_tcp.bytes, 0), fixed(row.tcp.bytes, 1), fixed(row.udp.bytes, 1),
                 fixed(row.icd_tcp.frame, 0), fixed(row.tcp.frame, 1), times(row.ratio_tcp),
                 fixed(row.icd_udp.frame, 0), fixed(row.udp.frame, 1), times(row.ratio_udp)});
    }
    const auto& with = report.headers;
    const auto& fit = report.in_a_frame;
    return out.text() + "bytes, means of " + std::to_string(report.exchanges) +
           " exchanges, measured between the ends; frames with Ethernet " + std::to_string(with.ethernet) + ", IPv4 " +
           std::to_string(with.ipv4) + " and TCP " + std::to_string(with.tcp) + " (with timestamps) or UDP " +
           std::to_string(with.udp) + "\nupdates in one frame of " + std::to_string(with.mtu) + " bytes: TCP, struct " +
           std::to_string(fit.icd_tcp) + ", CLES " + std::to_string(fit.tcp) + "; UDP, struct " +
           std::to_string(fit.icd_udp) + ", CLES " + std::to_string(fit.udp) + " (one to a datagram)\n";
}

} // namespace tool
