// SPDX-License-Identifier: BSL-1.0
// What encryption adds to a PULL: the same exchange over `tcp` and over `tls`, in passes by turns.
//
//   cles_tls_cost [PASSES [REQUESTS]]

#include <cles/link.hpp>
#include <cles/service.hpp>

#include "perf/pull/pull_exchange.hpp"
#include "perf/support/child_process.hpp"
#include "perf/support/latency_recorder.hpp"
#include "perf/support/pinning.hpp"
#include "security/fleet/fleet.hpp"
#include "security/fleet/fleet_authority.hpp"
#include "security/keys/keys.hpp"
#include "tls/tls_transport.hpp"

#include <boost/asio/io_context.hpp>

#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace cles::perf {
namespace {

/// A fleet of the two ends.
struct small_fleet {
    small_fleet() {
        authority.add({"car1", server.public_part()});
        authority.add({"bench", client.public_part()});
    }
    // In the process of that end.
    void use(const std::string& name, security::signing_key key) const {
        register_transport("tls", tls::make_tls_transport({.fleet = std::make_shared<security::fleet>(
                                                               name, std::move(key), authority.share()),
                                                           .epoch = "00000001"}));
    }

    security::signing_key server = security::signing_key::generate();
    security::signing_key client = security::signing_key::generate();
    security::fleet_authority authority = security::fleet_authority::found(security::signing_key::generate());
};

/// One transport: its server, and a client with an open link.
class exchange {
  public:
    exchange(small_fleet& of, placement where, std::string scheme)
        : scheme_(std::move(scheme)), server_(where.server, [&](const child_process::announce& announce) {
              of.use("car1", std::move(of.server));
              serve_localization(scheme_ + "://127.0.0.1:0", {}, announce);
          }) {}

    /// After all servers have been forked.
    void connect() {
        client_ = std::make_unique<service>(io_, service_options{.name = "bench"});
        client_->set_peer("car1", server_.announced());
        load_ = std::make_unique<pull_load>(io_, *client_, "car1:localization", handler_style::callback, true);
    }
    double p50(latency_recorder& record) {
        load_->run(1, std::chrono::nanoseconds::max(), record);
        return record.quantiles().p50;
    }

  private:
    std::string scheme_;
    child_process server_;
    boost::asio::io_context io_{1};
    std::unique_ptr<service> client_;
    std::unique_ptr<pull_load> load_;
};

void measure(std::size_t passes, std::size_t requests) {
    small_fleet of;
    const auto where = place_ends();
    exchange tcp{of, where, "tcp"};
    exchange tls{of, where, "tls"};
    pin_to(where.client);
    of.use("bench", std::move(of.client));
    tcp.connect();
    tls.connect();
    latency_recorder record{requests};
    std::vector<double> plain;
    std::vector<double> encrypted;
    std::vector<double> ratios;
    for (std::size_t i = 0; i <= passes; ++i) {
        const auto one = tcp.p50(record);
        const auto other = tls.p50(record);
        if (i != 0) { // the first warms up
            plain.push_back(one);
            encrypted.push_back(other);
            ratios.push_back(other / one);
        }
    }
    std::cout << "tcp  p50 " << median(plain) << " us\ntls  p50 " << median(encrypted) << " us\ntls/tcp  "
              << median(ratios) << " (median of " << passes << " passes of " << requests << " requests)\n";
}

} // namespace
} // namespace cles::perf

int main(int count, char** arguments) {
    try {
        const auto number = [&](int at, std::size_t otherwise) {
            return count > at ? std::strtoull(arguments[at], nullptr, 10) : otherwise;
        };
        cles::perf::measure(std::max<std::size_t>(1, number(1, 9)), std::max<std::size_t>(1, number(2, 20'000)));
        return 0;
    } catch (const std::exception& e) {
        std::cerr << "cles_tls_cost: " << e.what() << "\n";
        return 1;
    }
}
