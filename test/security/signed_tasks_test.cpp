// SPDX-License-Identifier: BSL-1.0
#include <cles/routing.hpp>

#include "security/keys/signed_text.hpp"
#include "security/raw_member.hpp"
#include "security/secured_services.hpp"
#include "support/group_address.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace signed_tasks {
namespace {

using namespace cles::security::test;
using namespace std::chrono_literals;
using cles::errc;

const cles::task_info must_be_signed{.must_be_signed = true};
const std::string done = "{\"value\":1}";
const std::string order = "{\"a\": 1,  \"b\":[2]}";
const std::string order_as_sent = R"({"a":1,"b":[2]})";

/// What a node serves that may only be signed.
struct weapon {
    explicit weapon(cles::service& at) {
        at.on_delegate(
            "strike",
            [this](const cles::request& r) {
                bodies.emplace_back(r.body());
                return static_cast<int>(bodies.size());
            },
            must_be_signed);
    }
    [[nodiscard]] std::size_t runs() const { return bodies.size(); }

    std::vector<std::string> bodies;
};

std::string text_after(const std::string& text, const std::string& before) {
    const auto at = text.find(before);
    BOOST_REQUIRE_MESSAGE(at != std::string::npos, text);
    const auto start = at + before.size();
    return text.substr(start, text.find('"', start) - start);
}

/// The outcome of a request with these options, as in `ask`.
std::string ask_with(boost::asio::io_context& io, cles::service& by, const std::string& command,
                     cles::call_options options) {
    std::optional<std::string> found;
    std::string why;
    by.async_request(command, options.diagnostics(why), [&](boost::system::error_code code, const cles::json_text& r) {
        found = code ? code.message() + ": " + why : r.text;
    });
    cles::test::run_until(io, [&] { return found.has_value(); });
    return *found;
}

struct fixture {
    fixture() {
        fleet.add("sat1", {.forwards = {"*"}});
        fleet.add("sat2");
    }
    /// The value of `sig=`, of a requester that waits for a while.
    [[nodiscard]] std::string signature(const std::string& by, const std::string& challenge,
                                        const std::string& body) const {
        const auto own = cles::security::key_directory{fleet.directory_of(by)}.read_node();
        return cles::security::sign(own.own.key, fleet.authority.newest().fleet(),
                                    cles::security::signed_request{.requester = by,
                                                                   .node = "car1",
                                                                   .challenge = challenge,
                                                                   .kind = cles::verb::delegate,
                                                                   .noun = "strike",
                                                                   .body = body,
                                                                   .waits_ms = 30'000}) +
               ".30000";
    }

    boost::asio::io_context io;
    secured_fleet fleet{"car1", "car2"};
};

/// car1 executes, car2 asks.
struct two : fixture {
    cles::service car1{io, fleet.options("car1")};
    weapon armed{car1};
    cles::service car2{io, fleet.knowing("car2", car1)};
};

/// Nodes that know each other by the group.
struct discovered : fixture {
    cles::service_options options(const std::string& name, bool routes = false) {
        auto made = fleet.options(name);
        made.multicast = where;
        made.routing = routes ? cles::routing() : nullptr;
        return made;
    }
    void know(cles::service& by, const std::string& name) {
        cles::test::run_until(io, [&] { return contains(ask(io, by, "PULL self:cles/peers"), "\"" + name + "\""); });
    }
    cles::multicast_options where = cles::test::fresh_group();
};

/// sat1 forwards for car2 to car1. No node announces itself.
struct unannounced : fixture {
    [[nodiscard]] cles::service_options forwarding() const {
        auto made = fleet.knowing("sat1", car1);
        made.routing = cles::routing();
        return made;
    }
    [[nodiscard]] cles::bind_options by_sat1() const {
        cles::bind_options made;
        made.at(sat1.endpoints().front());
        return made;
    }

    cles::service car1{io, fleet.options("car1")};
    cles::service sat1{io, forwarding()};
    cles::service car2{io, fleet.options("car2")};
};

/// Collects the values of a feed.
struct collector {
    explicit collector(cles::service& by, const std::string& noun, cles::bind_options options = {}) {
        by.async_bind<int>(noun, options, [this](boost::system::error_code code, cles::feed<int> made) {
            BOOST_REQUIRE_MESSAGE(!code, code.message());
            feed = std::move(made);
            next();
        });
    }
    void next() {
        feed.async_next([this](boost::system::error_code failed, const auto& event) {
            if (!failed) {
                if (event.kind == cles::feed_event::update || event.kind == cles::feed_event::current) {
                    values.push_back(event.value);
                }
                next();
            }
        });
    }

    cles::feed<int> feed;
    std::vector<int> values;
};

std::uint64_t unsigned_updates(boost::asio::io_context& io, cles::service& at) {
    const auto metrics = ask(io, at, "PULL self:cles/metrics");
    return std::stoull(text_after(metrics, "\"updates_unsigned\":"));
}

} // namespace
} // namespace signed_tasks

BOOST_AUTO_TEST_SUITE(signed_tasks)

BOOST_FIXTURE_TEST_SUITE(requests, two)

BOOST_AUTO_TEST_CASE(one_runs_once_with_the_body_as_it_was_sent) {
    BOOST_TEST(ask(io, car2, "DELEGATE car1:strike " + order) == done);
    BOOST_TEST(armed.bodies == std::vector<std::string>{order_as_sent}, boost::test_tools::per_element());
    BOOST_TEST(ask(io, car2, "DELEGATE car1:strike") == "{\"value\":2}");
}

BOOST_AUTO_TEST_CASE(an_own_one_is_signed_too) {
    BOOST_TEST(ask(io, car1, "DELEGATE self:strike " + order) == done);
    BOOST_TEST(ask(io, car1, "DELEGATE car1:strike " + order) == "{\"value\":2}");
}

BOOST_AUTO_TEST_CASE(parameters_are_signed_as_nodes_write_them) {
    car1.on_pull(
        "shot", [](const cles::request& r) { return std::string{r.parameters()[0]}; }, must_be_signed);
    BOOST_TEST(ask(io, car2, "PULL car1:shot/a%20b") == "{\"value\":\"a b\"}");
    BOOST_TEST(ask(io, car2, "PULL car1:shot/%61%2fb") == "{\"value\":\"a/b\"}");
}

BOOST_AUTO_TEST_CASE(urgent_ones_use_their_own_link) {
    BOOST_TEST(ask_with(io, car2, "DELEGATE car1:strike " + order, cles::call_options{}.urgent()) == done);
}

BOOST_AUTO_TEST_CASE(several_run_at_a_time) {
    int answered = 0;
    for (int i = 0; i < 20; ++i) {
        car2.async_request("DELEGATE car1:strike {\"i\":" + std::to_string(i) + "}",
                           [&](boost::system::error_code code, const cles::json_text&) {
                               BOOST_TEST(!code);
                               ++answered;
                           });
    }
    cles::test::run_until(io, [&] { return answered == 20; });
    BOOST_TEST(armed.runs() == 20U);
}

BOOST_AUTO_TEST_CASE(one_can_be_cancelled_during_its_second_attempt) {
    std::vector<cles::responder> waiting;
    car1.on_delegate(
        "aim", [&](const cles::request&, cles::responder to) { waiting.push_back(std::move(to)); }, must_be_signed);
    boost::asio::cancellation_signal signal;
    std::optional<boost::system::error_code> code;
    car2.async_request("DELEGATE car1:aim", boost::asio::bind_cancellation_slot(
                                                signal.slot(), [&](boost::system::error_code failed,
                                                                   const cles::json_text&) { code = failed; }));
    cles::test::run_until(io, [&] { return !waiting.empty(); });
    signal.emit(boost::asio::cancellation_type::terminal);
    cles::test::run_until(io, [&] { return code.has_value(); });
    BOOST_TEST((*code == errc::cancelled));
    cles::test::run_until(io, [&] { return waiting.front().stopped(); });
}

BOOST_AUTO_TEST_CASE(its_deadline_covers_both_attempts) {
    std::vector<cles::responder> waiting;
    car1.on_delegate(
        "aim", [&](const cles::request&, cles::responder to) { waiting.push_back(std::move(to)); }, must_be_signed);
    const auto told = ask_with(io, car2, "DELEGATE car1:aim", cles::call_options{}.deadline(300ms));
    BOOST_TEST(told != done);
    BOOST_TEST(waiting.size() == 1U);
}

BOOST_AUTO_TEST_CASE(progress_is_reported) {
    car1.on_delegate(
        "aim",
        [](const cles::request&, const cles::responder& to) {
            to.progress(0.5);
            to.done(1);
        },
        must_be_signed);
    double seen = 0;
    BOOST_TEST(ask_with(io, car2, "DELEGATE car1:aim",
                        cles::call_options{}.on_progress([&](double f, std::string_view) { seen = f; })) == done);
    BOOST_TEST(seen == 0.5);
}

BOOST_AUTO_TEST_CASE(a_wrong_signature_runs_nothing) {
    const auto member = raw_member::connect(io, fleet, "car2", car1);
    const auto told = member->ask("DELEGATE car1:strike id=7 " + order);
    BOOST_TEST(contains(told, "\"node\":\"car1\""), told);
    const auto challenge = text_after(told, "\"challenge\":\"");
    BOOST_TEST(challenge.size() == 22U);
    const auto of = [&](const std::string& sig) {
        return member->ask("DELEGATE car1:strike id=7 sig=" + sig + " " + order);
    };
    BOOST_TEST(contains(of(signature("sat1", challenge, order)), "denied"));
    BOOST_TEST(armed.runs() == 0U);
    member->close();
}

BOOST_AUTO_TEST_CASE(a_forwarder_cannot_prolong_it) {
    const auto member = raw_member::connect(io, fleet, "car2", car1);
    const auto challenge = text_after(member->ask("DELEGATE car1:strike id=7 " + order), "\"challenge\":\"");
    auto sig = signature("car2", challenge, order);
    sig += "0";
    BOOST_TEST(contains(member->ask("DELEGATE car1:strike id=7 sig=" + sig + " " + order), "denied"));
    BOOST_TEST(armed.runs() == 0U);
    member->close();
}

BOOST_AUTO_TEST_CASE(a_repeated_signature_runs_nothing) {
    const auto member = raw_member::connect(io, fleet, "car2", car1);
    const auto challenge = text_after(member->ask("DELEGATE car1:strike id=7 " + order), "\"challenge\":\"");
    const auto line = "DELEGATE car1:strike id=7 sig=" + signature("car2", challenge, order) + " " + order;
    BOOST_TEST(member->ask(line) == done);
    BOOST_TEST(contains(member->ask(line), "denied"));
    const auto other = raw_member::connect(io, fleet, "car2", car1);
    BOOST_TEST(contains(other->ask(line), "denied"));
    BOOST_TEST(armed.runs() == 1U);
    member->close();
    other->close();
}

BOOST_AUTO_TEST_CASE(an_expired_challenge_runs_nothing) {
    const auto member = raw_member::connect(io, fleet, "car2", car1);
    const auto told = member->ask("DELEGATE car1:strike id=7 deadline=20 " + order);
    boost::asio::steady_timer later{io, 30ms};
    bool expired = false;
    later.async_wait([&](boost::system::error_code) { expired = true; });
    cles::test::run_until(io, [&] { return expired; });
    const auto sig = signature("car2", text_after(told, "\"challenge\":\""), order);
    BOOST_TEST(contains(member->ask("DELEGATE car1:strike id=7 sig=" + sig + " " + order), "denied"));
    BOOST_TEST(armed.runs() == 0U);
    member->close();
}

BOOST_AUTO_TEST_CASE(a_forwarder_cannot_alter_it) {
    const auto forwarder = raw_member::connect(io, fleet, "sat1", car1);
    const auto first = forwarder->ask("DELEGATE car1:strike id=7 from=car2 " + order);
    const auto sig = signature("car2", text_after(first, "\"challenge\":\""), order);
    const std::string forged = "{\"a\":2}";
    BOOST_TEST(contains(forwarder->ask("DELEGATE car1:strike id=7 from=car2 sig=" + sig + " " + forged), "denied"));
    BOOST_TEST(armed.runs() == 0U);
    BOOST_TEST(forwarder->ask("DELEGATE car1:strike id=7 from=car2 sig=" + sig + " " + order) == done);
    const auto second = forwarder->ask("DELEGATE car1:strike id=7 from=car2 " + order);
    const auto own = signature("sat1", text_after(second, "\"challenge\":\""), order);
    BOOST_TEST(contains(forwarder->ask("DELEGATE car1:strike id=7 from=car2 sig=" + own + " " + order), "denied"));
    BOOST_TEST(armed.runs() == 1U);
    forwarder->close();
}

BOOST_AUTO_TEST_CASE(without_security_it_is_denied) {
    cles::service open{io, {.name = "open"}};
    weapon unused{open};
    const auto told = ask(io, open, "DELEGATE self:strike");
    BOOST_TEST(contains(told, "has no security"), told);
    BOOST_CHECK_EXCEPTION(open.update("strike", 1), cles::error,
                          [](const cles::error& e) { return e.code() == errc::denied; });
    BOOST_TEST(unused.runs() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_FIXTURE_TEST_SUITE(routed, fixture)

BOOST_AUTO_TEST_CASE(one_is_forwarded_from_end_to_end) {
    cles::service car1{io, fleet.options("car1")};
    weapon armed{car1};
    auto router = fleet.knowing("sat1", car1);
    router.routing = cles::routing();
    cles::service sat1{io, std::move(router)};
    cles::service car2{io, fleet.options("car2")};
    std::string requester;
    const auto by_sat1 = cles::call_options{}.at(sat1.endpoints().front());
    BOOST_TEST(ask_with(io, car2, "DELEGATE car1:strike " + order, by_sat1) == done);
    BOOST_TEST(armed.bodies == std::vector<std::string>{order_as_sent}, boost::test_tools::per_element());
}

BOOST_FIXTURE_TEST_CASE(any_runs_it_at_one_node, discovered) {
    cles::service car1{io, options("car1")};
    weapon first{car1};
    cles::service sat2{io, options("sat2")};
    weapon second{sat2};
    cles::service car2{io, options("car2", true)};
    know(car2, "car1");
    know(car2, "sat2");
    for (std::size_t i = 1; i <= 10; ++i) {
        const auto told = ask(io, car2, "DELEGATE any:strike " + order);
        BOOST_TEST(contains(told, "value"), told);
        BOOST_TEST(first.runs() + second.runs() == i);
    }
}

BOOST_FIXTURE_TEST_CASE(any_signs_for_no_node_that_may_not_offer_it, discovered) {
    fleet.authority.set_rights("car1", {.offers = std::vector<std::string>{"pull *:other"}});
    fleet.add("car4");
    cles::service car1{io, options("car1")};
    weapon armed{car1};
    cles::service car2{io, options("car2", true)};
    know(car2, "car1");
    const auto told = ask(io, car2, "DELEGATE any:strike " + order);
    BOOST_TEST(!contains(told, "value"), told);
    BOOST_TEST(armed.runs() == 0U);
}

BOOST_FIXTURE_TEST_CASE(all_runs_it_once_at_each, discovered) {
    cles::service car1{io, options("car1")};
    weapon first{car1};
    cles::service sat2{io, options("sat2")};
    sat2.on_delegate("strike", [] { return 5; });
    cles::service car2{io, options("car2", true)};
    weapon own{car2};
    know(car2, "car1");
    know(car2, "sat2");
    std::string told;
    cles::test::run_until(io, [&] {
        first.bodies.clear();
        own.bodies.clear();
        told = ask(io, car2, "DELEGATE all:strike " + order);
        return contains(told, "sat2") && contains(told, "car1"); // their tasks are known
    });
    BOOST_TEST(told == R"({"results":{"car1":{"value":1},"car2":{"value":1},"sat2":{"value":5}},"errors":{}})");
    BOOST_TEST(first.runs() == 1U);
    BOOST_TEST(own.runs() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_FIXTURE_TEST_SUITE(updates, fixture)

BOOST_AUTO_TEST_CASE(they_are_received_by_link) {
    cles::service car1{io, fleet.options("car1")};
    car1.on_bind("control", must_be_signed);
    cles::service car2{io, fleet.knowing("car2", car1)};
    collector seen{car2, "car1:control"};
    int value = 0;
    cles::test::run_until(io, [&] {
        car1.update("control", ++value);
        return seen.values.size() > 10;
    });
    BOOST_TEST(unsigned_updates(io, car2) == 0U);
    seen.feed.close();
}

BOOST_FIXTURE_TEST_CASE(they_are_received_through_a_forwarder, discovered) {
    cles::service car1{io, options("car1")};
    car1.on_bind("control", must_be_signed);
    cles::service sat1{io, options("sat1", true)};
    cles::service car2{io, options("car2")};
    know(sat1, "car1");
    know(car2, "car1");
    collector seen{car2, "car1:control", [&] {
                       cles::bind_options by_sat1;
                       by_sat1.at(sat1.endpoints().front());
                       return by_sat1;
                   }()};
    int value = 0;
    cles::test::run_until(io, [&] {
        car1.update("control", ++value);
        return seen.values.size() > 10;
    });
    BOOST_TEST(unsigned_updates(io, sat1) == 0U);
    BOOST_TEST(unsigned_updates(io, car2) == 0U);
    seen.feed.close();
}

BOOST_FIXTURE_TEST_CASE(a_forwarded_value_without_signature_counts_as_missing, discovered) {
    cles::service car1{io, options("car1")};
    car1.on_bind("control", must_be_signed);
    car1.update("control", 1);
    car1.update("pose", 1);
    cles::service sat1{io, options("sat1", true)};
    cles::service car2{io, options("car2")};
    know(sat1, "car1");
    know(car2, "car1");
    cles::bind_options by_sat1;
    by_sat1.at(sat1.endpoints().front());
    collector direct{sat1, "car1:control"};
    collector forwarded{car2, "car1:control", by_sat1};
    collector other{car2, "car1:pose", by_sat1};
    cles::test::run_until(io, [&] { return direct.values.size() == 1 && other.values.size() == 1; });
    cles::test::run_until(io, [&] { return forwarded.feed.is_open(); });
    BOOST_TEST(forwarded.values.empty());
    car1.update("control", 2);
    cles::test::run_until(io, [&] { return !forwarded.values.empty(); });
    BOOST_TEST(forwarded.values.front() == 2);
    for (auto* each : {&direct, &forwarded, &other}) {
        each->feed.close();
    }
}

BOOST_FIXTURE_TEST_CASE(they_are_received_without_an_announcement, unannounced) {
    car1.on_bind("control", must_be_signed);
    car1.update("control", 1);
    car1.update("pose", 1);
    collector control{car2, "car1:control", by_sat1()};
    collector pose{car2, "car1:pose", by_sat1()};
    cles::test::run_until(io, [&] { return control.feed.is_open() && pose.values.size() == 1; });
    BOOST_TEST(control.values.empty()); // that value is not signed
    int value = 1;
    cles::test::run_until(io, [&] {
        ++value;
        car1.update("control", value);
        car1.update("pose", value);
        return control.values.size() > 3 && pose.values.size() > 3;
    });
    BOOST_TEST(unsigned_updates(io, sat1) == 0U);
    BOOST_TEST(unsigned_updates(io, car2) == 0U);
    control.feed.close();
    pose.feed.close();
}

// The link does not prove which node listens there.
BOOST_FIXTURE_TEST_CASE(they_are_received_at_a_unix_socket, fixture) {
    auto options = fleet.options("car1");
    options.listen = {"unix://" + fleet.directory_of("car1") + "/socket"};
    cles::service car1{io, std::move(options)};
    car1.on_bind("control", must_be_signed);
    cles::bind_options there;
    there.at(car1.endpoints().front());
    for (const std::string target : {"car1", "self"}) {
        BOOST_TEST_CONTEXT(target) {
            cles::service car2{io, fleet.options("car2")};
            collector seen{car2, target + ":control", there};
            int value = 0;
            cles::test::run_until(io, [&] {
                car1.update("control", ++value);
                return seen.values.size() > 3;
            });
            BOOST_TEST(unsigned_updates(io, car2) == 0U);
            seen.feed.close();
        }
    }
}

BOOST_FIXTURE_TEST_CASE(they_are_received_by_multicast, discovered) {
    cles::service car1{io, options("car1")};
    car1.on_bind("control", must_be_signed);
    cles::service car2{io, options("car2")};
    know(car2, "car1");
    cles::bind_options by_group;
    by_group.multicast();
    collector seen{car2, "all:control", by_group};
    int value = 0;
    cles::test::run_until(io, [&] {
        car1.update("control", ++value);
        return seen.values.size() > 10;
    });
    BOOST_TEST(unsigned_updates(io, car2) == 0U);
    seen.feed.close();
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
