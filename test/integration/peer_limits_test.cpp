// SPDX-License-Identifier: BSL-1.0
// Nodes that read lines of different lengths: one client's long line harms no other client.

#include <cles/gossip.hpp>
#include <cles/responder.hpp>
#include <cles/routing.hpp>
#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <utility>

BOOST_AUTO_TEST_SUITE(peer_limits)

using namespace cles::test;
using cles::errc;

namespace {

/// A hub, and a node behind it that reads shorter lines than the hub does.
struct fixture {
    static constexpr std::size_t line = 4096;

    fixture() {
        car->on_delegate("work", [this](const cles::request&, cles::responder answer) { held = std::move(answer); });
        car->on_push("take", [] {});
    }

    enum class acquaintance { gossiped, configured };
    void start_hub(acquaintance how) {
        cles::service_options options{.name = "hub"};
        options.listen = {"tcp://127.0.0.1:0"};
        options.routing = cles::routing();
        options.peers.emplace("car1", car->endpoints().front());
        if (how == acquaintance::gossiped) {
            options.gossip = cles::gossip({car->endpoints().front()});
        }
        hub.emplace(io, std::move(options));
        if (how == acquaintance::gossiped) {
            run_until(io, [this] { return !hub->peers().empty(); });
        }
        user.emplace(io, cles::service_options{.name = "user"});
    }
    void ask(answer<>& what, const std::string& command) {
        user->async_request(command, what.options().at(hub->endpoints().front()), what.take());
    }
    /// A request of another client runs at the node, and then one comes that is too long for it.
    void send_both() {
        ask(job, "DELEGATE car1:work");
        run_until(io, [this] { return held.has_value(); });
        ask(too_long, "PUSH car1:take {\"text\":\"" + std::string(line, 'x') + "\"}");
        run_until(io, [this] { return too_long.done(); });
        BOOST_TEST(too_long.code == errc::too_large);
    }

    boost::asio::io_context io;
    std::optional<cles::responder> held;
    std::unique_ptr<cles::service> car = [this] {
        cles::service_options options{.name = "car1"};
        options.listen = {"tcp://127.0.0.1:0"};
        options.limits.line = line;
        options.gossip = cles::gossip();
        return std::make_unique<cles::service>(io, std::move(options));
    }();
    std::optional<cles::service> hub;
    std::optional<cles::service> user;
    answer<> job;
    answer<> too_long;
};

} // namespace

BOOST_FIXTURE_TEST_CASE(what_a_node_would_not_read_is_refused_before_it_is_sent, fixture) {
    start_hub(acquaintance::gossiped);
    send_both();
    BOOST_TEST(too_long.words.find("car1 reads requests of at most 4096 bytes") != std::string::npos, too_long.words);
    BOOST_TEST(!job.done());
    held->done();
    run_until(io, [this] { return job.done(); });
    BOOST_TEST(!job.code, job.words);
}

// An address that was configured may be anybody's: it is not asked.
BOOST_FIXTURE_TEST_CASE(who_did_not_cancel_is_not_told_so_when_a_long_line_ends_the_link, fixture) {
    start_hub(acquaintance::configured);
    send_both();
    run_until(io, [this] { return job.done(); });
    BOOST_TEST(job.code == errc::unavailable);
    BOOST_TEST(job.words.find("limits.line") != std::string::npos, job.words);
}

BOOST_AUTO_TEST_SUITE_END()
