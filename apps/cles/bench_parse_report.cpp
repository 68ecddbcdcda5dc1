// SPDX-License-Identifier: BSL-1.0
#include "bench_parse_report.hpp"

#include "bench_table.hpp"

namespace tool {
namespace {

/// "4096 (1.00)"
std::string cell(const parse_figure& figure) { return fixed(figure.ns, 0) + " (" + fixed(figure.ns_per_byte, 2) + ")"; }

} // namespace

std::string table_of(const parse_report& report) {
    rows out{{"bytes", "head", "validated", "typed", "reply", "reply typed", "struct bytes", "struct"}};
    for (const auto& row : report.rows) {
        out.add({std::to_string(row.bytes), cell(row.head), cell(row.validated), cell(row.typed),
                 cell(row.reply_validated), cell(row.reply_typed), std::to_string(row.packed_bytes), cell(row.packed)});
    }
    return out.text() + "ns (ns per byte), medians of " + std::to_string(report.rounds) + " rounds on core " +
           std::to_string(report.core) +
           ", without sockets: from the line to the handler and its reply; from a reply to the caller;\n"
           "from a struct in network order to the same numbers\n";
}

} // namespace tool
