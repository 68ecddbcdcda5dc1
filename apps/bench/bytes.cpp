// SPDX-License-Identifier: BSL-1.0
#include "figures.hpp"
#include "measurements.hpp"
#include "perf/baseline/packet.hpp"
#include "perf/messages/wire_bytes.hpp"
#include "progress.hpp"
#include "report_table.hpp"

#include <boost/describe/class.hpp>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace tool {

namespace perf = cles::perf;

namespace {

/// The headers of a message that is sent in a packet of its own.
struct header_bytes {
    std::uint64_t ethernet = 14;
    std::uint64_t ipv4 = 20;
    std::uint64_t tcp = 32; ///< 20, and 12 of timestamps
    std::uint64_t udp = 8;
    std::uint64_t mtu = 1500; ///< of an Ethernet frame, from the IP header on
};
BOOST_DESCRIBE_STRUCT(header_bytes, (), (ethernet, ipv4, tcp, udp, mtu))

/// Bytes of a message, alone and in a frame of its own.
struct message_size {
    double bytes = 0;
    double frame = 0;
};
BOOST_DESCRIBE_STRUCT(message_size, (), (bytes, frame))

struct bytes_row {
    std::string message{}; ///< "PULL request"
    message_size icd_tcp{};
    message_size icd_udp{};
    message_size tcp{};
    message_size udp{};
    message_size unrounded_tcp{}; ///< CLES, with the packet's values unrounded
    message_size unrounded_udp{};
    double ratio_tcp = 0; ///< of the frames
    double ratio_udp = 0;
    double unrounded_ratio_tcp = 0;
    double unrounded_ratio_udp = 0;
};
BOOST_DESCRIBE_STRUCT(bytes_row, (),
                      (message, icd_tcp, icd_udp, tcp, udp, unrounded_tcp, unrounded_udp, ratio_tcp, ratio_udp,
                       unrounded_ratio_tcp, unrounded_ratio_udp))

/// How many published packets one full frame holds.
struct updates_per_frame {
    std::uint64_t icd_tcp = 0;
    std::uint64_t icd_udp = 0;
    std::uint64_t tcp = 0;
    std::uint64_t unrounded_tcp = 0;
    std::uint64_t udp = 1; ///< a datagram holds exactly one message
};
BOOST_DESCRIBE_STRUCT(updates_per_frame, (), (icd_tcp, icd_udp, tcp, unrounded_tcp, udp))

struct bytes_report {
    std::string bench = "bytes";
    std::uint64_t exchanges = 0; ///< of each verb
    header_bytes headers{};
    std::vector<bytes_row> rows{};
    updates_per_frame in_a_frame{};
};
BOOST_DESCRIBE_STRUCT(bytes_report, (), (bench, exchanges, headers, rows, in_a_frame))

std::string table_of(const bytes_report& report) {
    rows out{{"localization", "values", "struct", "CLES tcp", "CLES udp", "struct tcp frame", "CLES tcp frame", "ratio",
              "struct udp frame", "CLES udp frame", "ratio udp"}};
    for (const auto& row : report.rows) {
        const auto add = [&](const std::string& values, const message_size& tcp, const message_size& udp,
                             double ratio_tcp, double ratio_udp) {
            out.add({row.message, values, fixed(row.icd_tcp.bytes, 0), fixed(tcp.bytes, 1), fixed(udp.bytes, 1),
                     fixed(row.icd_tcp.frame, 0), fixed(tcp.frame, 1), times(ratio_tcp), fixed(row.icd_udp.frame, 0),
                     fixed(udp.frame, 1), times(ratio_udp)});
        };
        add("rounded", row.tcp, row.udp, row.ratio_tcp, row.ratio_udp);
        add("unrounded", row.unrounded_tcp, row.unrounded_udp, row.unrounded_ratio_tcp, row.unrounded_ratio_udp);
    }
    const auto& with = report.headers;
    const auto& fit = report.in_a_frame;
    return out.text() + "bytes, means of " + std::to_string(report.exchanges) +
           " exchanges, measured between the ends; frames with Ethernet " + std::to_string(with.ethernet) + ", IPv4 " +
           std::to_string(with.ipv4) + " and TCP " + std::to_string(with.tcp) + " (with timestamps) or UDP " +
           std::to_string(with.udp) + "\nupdates in one frame of " + std::to_string(with.mtu) + " bytes: TCP, struct " +
           std::to_string(fit.icd_tcp) + ", CLES " + std::to_string(fit.tcp) + " (unrounded " +
           std::to_string(fit.unrounded_tcp) + "); UDP, struct " + std::to_string(fit.icd_udp) + ", CLES " +
           std::to_string(fit.udp) + " (one to a datagram)\n";
}

constexpr std::uint64_t default_exchanges = 2000;

// The struct's messages: one without the packet, and one with it.
constexpr double word = sizeof(perf::icd::request_packet);
constexpr double packet = sizeof(perf::icd::reply_packet);
constexpr perf::verb_bytes interface_control_document{.pull = {word, packet},
                                                      .push = {packet, word},
                                                      .delegate = {packet, packet},
                                                      .ask = {packet, word},
                                                      .bind = {word, packet},
                                                      .update = packet};

/// What the relays counted: the packet with rounded values, and with all their digits.
struct counted_bytes {
    perf::verb_bytes tcp{};
    perf::verb_bytes udp{};
    perf::verb_bytes unrounded_tcp{};
    perf::verb_bytes unrounded_udp{};
};

/// Calculates the frames of messages, and compares them.
class framing {
  public:
    explicit framing(const header_bytes& headers) : headers_(headers) {}

    /// \param bytes_of the bytes of the message, of those of all verbs
    template <class F>
    [[nodiscard]] bytes_row row(std::string message, const counted_bytes& counted, F bytes_of) const {
        bytes_row made{.message = std::move(message),
                       .icd_tcp = over_tcp(bytes_of(interface_control_document)),
                       .icd_udp = over_udp(bytes_of(interface_control_document)),
                       .tcp = over_tcp(bytes_of(counted.tcp)),
                       .udp = over_udp(bytes_of(counted.udp)),
                       .unrounded_tcp = over_tcp(bytes_of(counted.unrounded_tcp)),
                       .unrounded_udp = over_udp(bytes_of(counted.unrounded_udp))};
        made.ratio_tcp = over(made.tcp.frame, made.icd_tcp.frame);
        made.ratio_udp = over(made.udp.frame, made.icd_udp.frame);
        made.unrounded_ratio_tcp = over(made.unrounded_tcp.frame, made.icd_tcp.frame);
        made.unrounded_ratio_udp = over(made.unrounded_udp.frame, made.icd_udp.frame);
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

std::string measure_bytes(const bench_options& options) {
    const auto exchanges = options.requests != 0 ? options.requests : default_exchanges;
    bench_progress progress{2};
    counted_bytes counted;
    progress.step("over TCP");
    counted.tcp = perf::measure_bytes("tcp", exchanges, perf::sample);
    counted.unrounded_tcp = perf::measure_bytes("tcp", exchanges, perf::unrounded_sample);
    progress.step("over UDP");
    counted.udp = perf::measure_bytes("udp", exchanges, perf::sample);
    counted.unrounded_udp = perf::measure_bytes("udp", exchanges, perf::unrounded_sample);

    bytes_report report{.exchanges = exchanges};
    const framing frames{report.headers};
    const auto add = [&](const std::string& verb, perf::exchange_bytes perf::verb_bytes::*of) {
        const auto request = [of](const perf::verb_bytes& all) { return (all.*of).request; };
        const auto reply = [of](const perf::verb_bytes& all) { return (all.*of).reply; };
        report.rows.push_back(frames.row(verb + " request", counted, request));
        report.rows.push_back(frames.row(verb + " reply", counted, reply));
    };
    add("PULL", &perf::verb_bytes::pull);
    add("PUSH", &perf::verb_bytes::push);
    add("DELEGATE", &perf::verb_bytes::delegate);
    add("UPDATE", &perf::verb_bytes::ask);
    add("BIND", &perf::verb_bytes::bind);
    report.rows.push_back(frames.row("update", counted, [](const perf::verb_bytes& all) { return all.update; }));
    report.in_a_frame = {.icd_tcp = frames.fit_tcp(interface_control_document.update),
                         .icd_udp = frames.fit_udp(interface_control_document.update),
                         .tcp = frames.fit_tcp(counted.tcp.update),
                         .unrounded_tcp = frames.fit_tcp(counted.unrounded_tcp.update)};
    return text_of(report, options);
}

} // namespace tool
