// SPDX-License-Identifier: BSL-1.0
#include "bench_medians.hpp"
#include "bench_progress.hpp"
#include "bench_run.hpp"
#include "perf/baseline/packet.hpp"
#include "perf/messages/wire_bytes.hpp"

#include <string>

namespace tool {

namespace perf = cles::perf;

namespace {

constexpr std::uint64_t exchanges_unless_told = 2000;

// The struct's messages: one without the packet, and one with it.
constexpr double word = sizeof(perf::icd::request_packet);
constexpr double packet = sizeof(perf::icd::reply_packet);
constexpr perf::verb_bytes interface_control_document{.pull = {word, packet},
                                                      .push = {packet, word},
                                                      .delegate = {packet, packet},
                                                      .ask = {packet, word},
                                                      .bind = {word, packet},
                                                      .update = packet};

/// Puts messages into frames and beside each other.
class framing {
  public:
    explicit framing(const header_bytes& headers) : headers_(headers) {}

    [[nodiscard]] bytes_row row(std::string message, double by_hand, double tcp, double udp) const {
        bytes_row made{.message = std::move(message),
                       .icd_tcp = over_tcp(by_hand),
                       .icd_udp = over_udp(by_hand),
                       .tcp = over_tcp(tcp),
                       .udp = over_udp(udp)};
        made.ratio_tcp = over(made.tcp.frame, made.icd_tcp.frame);
        made.ratio_udp = over(made.udp.frame, made.icd_udp.frame);
        return made;
    }
    /// How many fit into a full frame.
    [[nodiscard]] std::uint64_t fit_tcp(double bytes) const { return fit(bytes, headers_.tcp); }
    [[nodiscard]] std::uint64_t fit_udp(double bytes) const { return fit(bytes, headers_.udp); }

  private:
    [[nodiscard]] message_size over_tcp(double bytes) const { return framed(bytes, headers_.tcp); }
    [[nodiscard]] message_size over_udp(double bytes) const { return framed(bytes, headers_.udp); }
    [[nodiscard]] message_size framed(double bytes, std::uint64_t transport) const {
        const auto headers = static_cast<double>(headers_.ethernet + headers_.ipv4 + transport);
        return {.bytes = rounded(bytes), .frame = rounded(bytes + headers)};
    }
    [[nodiscard]] std::uint64_t fit(double bytes, std::uint64_t transport) const {
        return static_cast<std::uint64_t>(static_cast<double>(headers_.mtu - headers_.ipv4 - transport) / bytes);
    }

    header_bytes headers_;
};

} // namespace

bytes_report bench_bytes(const bench_options& options) {
    const auto exchanges = options.requests != 0 ? options.requests : exchanges_unless_told;
    bench_progress progress{2};
    progress.step("over TCP");
    const auto tcp = perf::measure_bytes("tcp", exchanges);
    progress.step("over UDP");
    const auto udp = perf::measure_bytes("udp", exchanges);

    bytes_report report{.exchanges = exchanges};
    const framing frames{report.headers};
    const auto add = [&](const std::string& verb, perf::exchange_bytes perf::verb_bytes::*of) {
        report.rows.push_back(frames.row(verb + " request", (interface_control_document.*of).request, (tcp.*of).request,
                                         (udp.*of).request));
        report.rows.push_back(
            frames.row(verb + " reply", (interface_control_document.*of).reply, (tcp.*of).reply, (udp.*of).reply));
    };
    add("PULL", &perf::verb_bytes::pull);
    add("PUSH", &perf::verb_bytes::push);
    add("DELEGATE", &perf::verb_bytes::delegate);
    add("UPDATE", &perf::verb_bytes::ask);
    add("BIND", &perf::verb_bytes::bind);
    report.rows.push_back(frames.row("update", interface_control_document.update, tcp.update, udp.update));
    report.in_a_frame = {.icd_tcp = frames.fit_tcp(interface_control_document.update),
                         .icd_udp = frames.fit_udp(interface_control_document.update),
                         .tcp = frames.fit_tcp(tcp.update)};
    return report;
}

} // namespace tool
