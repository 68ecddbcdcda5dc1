// SPDX-License-Identifier: BSL-1.0
// Every way on which a client's request can leave a node, and that none is open without the right to forward.
#include <cles/error.hpp>

#include "node/routing/other_pools.hpp"
#include "support/scripted_security.hpp"
#include "unit/node/sharing/sharing_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace ways_out {
namespace {

class one_pool final : public cles::core::other_pools {
  public:
    void start(cles::core::local_node&) override {}
    [[nodiscard]] std::string address_of(std::string_view) const override { return {}; }
    void on_security_changed() override {}
    [[nodiscard]] bool has_left() const override { return true; }
    [[nodiscard]] std::vector<known_pool> list() const override { return {{"north"}}; }
};

struct parts_of_fixture {
    std::shared_ptr<cles::test::scripted_security> security = std::make_shared<cles::test::scripted_security>();
    one_pool pools;
};

/// The node car1, whose client is sat1, with the neighbour car2 and the pool north.
struct fixture : parts_of_fixture, cles::test::sharing_fixture {
    fixture() : sharing_fixture(security, "sat1", &pools) {
        std::string tasks;
        for (const auto* const verb : {"PULL", "PUSH", "DELEGATE", "UPDATE"}) {
            tasks += task(verb, "there") + "," + task(verb, "both") + ",";
        }
        hear("car2", "with more tasks", {.queued = 100, .workers = 1});
        ways.to("car2").answers(description("car2", tasks + task("BIND", "there") + "," + task("DELEGATE", "work")));
        for (const auto each : {cles::verb::pull, cles::verb::push, cles::verb::delegate}) {
            node.on(each, "both",
                    [](const cles::request&, cles::json_writer&) { throw cles::error(cles::errc::busy, "not now"); });
        }
    }
    [[nodiscard]] std::size_t left() const { return ways.count() + ways.count_bound() + queue.moved.size(); }
    void grant_to_car2() {
        cles::test::test_link car2{node, "car2"};
        car2.ask(R"(PUSH self:cles/slots id=900 grant=00000000000000aa {"node":"car2","free":1})");
    }
};

/// What a client asks for, and where it leads.
struct way {
    std::string line;
    std::string to; ///< a node or pool; for a binding, the noun
    bool is_binding = false;
    bool is_gathered = false; ///< the reply lists the failures of nodes
};

const std::vector<way> ways_of_requests{
    {"PULL car2:there", "car2"},
    {"PUSH car2:there", "car2"},
    {"DELEGATE car2:there", "car2"},
    {"UPDATE car2:there {}", "car2"},
    {"PULL car2:cles", "car2"},
    {"PULL car2:cles/announced/0123456789012345678901", "car2"},
    {"PULL north.car3:there", "north.car3"},
    {"PULL any:there", "car2"},
    {"PUSH any:there", "car2"},
    {"DELEGATE any:there", "car2"},
    {"UPDATE any:there {}", "car2"},
    {"PULL any:far", "north.any"},
    {"DELEGATE any:far", "north.any"},
    {"PULL all:there", "car2", false, true},
    {"PUSH all:there", "car2", false, true},
    {"DELEGATE all:there", "car2", false, true},
    {"UPDATE all:there {}", "car2", false, true},
    {"PUSH all:far", "north.all", false, true},
    {"BIND car2:there", "car2:there", true},
    {"BIND north.car3:there", "north.car3:there", true},
    {"BIND all:there", "car2:there", true, true},
};

// This node is chosen for these, is busy, and so another one is asked.
const std::vector<way> ways_of_refused_requests{
    {"PULL any:both", "car2"},
    {"PUSH any:both", "car2"},
    {"DELEGATE any:both", "car2"},
};

std::string text_of(fixture& f, const way& each) {
    return each.is_binding ? f.ways.bound(each.to).text : f.ways.to(each.to).text;
}

} // namespace
} // namespace ways_out

BOOST_AUTO_TEST_SUITE(ways_out)

BOOST_AUTO_TEST_CASE(with_the_right_to_forward_each_leads_out_and_states_the_requester) {
    for (const auto* const all : {&ways_of_requests, &ways_of_refused_requests}) {
        for (const auto& each : *all) {
            BOOST_TEST_CONTEXT(each.line) {
                fixture f;
                const auto before = f.left();
                f.link.ask(each.line.substr(0, each.line.find('{')) + " id=7");
                BOOST_TEST(f.left() > before);
                const std::string part = each.line.starts_with("DELEGATE all:") ? "all," : ""; // it must not move
                BOOST_TEST(text_of(f, each).find(" via=" + part + "car1 from=sat1") != std::string::npos,
                           text_of(f, each));
            }
        }
    }
    fixture f;
    f.submit("DELEGATE car1:work id=7");
    f.grant_to_car2();
    BOOST_TEST(f.sent().text == "DELEGATE car2:work hops=0 via=car1 from=sat1 grant=00000000000000aa {}");
}

BOOST_AUTO_TEST_CASE(without_the_right_to_forward_none_does) {
    const std::string why = R"("error":"denied","message":"car1 may not forward requests of sat1 to )";
    for (const auto& each : ways_of_requests) {
        BOOST_TEST_CONTEXT(each.line) {
            fixture f;
            f.security->forwarders = {};
            const auto before = f.left();
            const auto reply = f.link.ask(each.line.substr(0, each.line.find('{')) + " id=7");
            BOOST_TEST(f.left() == before);
            BOOST_TEST(reply.find(why) != std::string::npos, reply);
            BOOST_TEST((reply.find(R"("results":{})") != std::string::npos) == each.is_gathered, reply);
            BOOST_REQUIRE(!f.logged.empty());
            BOOST_TEST(f.logged.front().starts_with("sat1 was denied "), f.logged.front());
        }
    }
    for (const auto& each : ways_of_refused_requests) {
        BOOST_TEST_CONTEXT(each.line) {
            fixture f;
            f.security->forwarders = {};
            const auto before = f.left();
            BOOST_TEST(f.link.kind(each.line + " id=7") == "id=7 busy");
            BOOST_TEST(f.left() == before);
        }
    }
    fixture f;
    f.security->forwarders = {};
    f.submit("DELEGATE car1:work id=7");
    f.grant_to_car2();
    BOOST_TEST(f.queue.moved.empty());
}

// call_options::on_behalf_of: the node's own program asks at the node itself, and states the member.
BOOST_AUTO_TEST_CASE(what_the_program_asks_on_behalf_of_a_member_takes_the_same_ways) {
    for (const auto& each : ways_of_requests) {
        for (const bool may_forward : {true, false}) {
            BOOST_TEST_CONTEXT(each.line << (may_forward ? "" : " without the right")) {
                fixture f;
                if (!may_forward) {
                    f.security->forwarders = {};
                }
                cles::test::test_link own{f.node, 0, std::string{}, "inproc"};
                const auto before = f.left();
                const auto reply = own.ask(each.line.substr(0, each.line.find('{')) + " id=7 from=sat1");
                if (!may_forward) {
                    BOOST_TEST(f.left() == before);
                    BOOST_TEST(reply.find("car1 may not forward requests of sat1") != std::string::npos, reply);
                    continue;
                }
                BOOST_TEST(f.left() > before);
                const std::string part = each.line.starts_with("DELEGATE all:") ? "all," : "";
                BOOST_TEST(text_of(f, each).find(" via=" + part + "car1 from=sat1") != std::string::npos,
                           text_of(f, each));
            }
        }
    }
}

BOOST_AUTO_TEST_CASE(none_leads_to_a_node_of_which_the_requester_may_not_ask_it) {
    for (const auto* const all : {&ways_of_requests, &ways_of_refused_requests}) {
        for (const auto& each : *all) {
            if (each.to == "north.any" || each.to == "north.all") {
                continue; // each node there decides
            }
            BOOST_TEST_CONTEXT(each.line) {
                fixture f;
                f.security->refuses_all_at = {"car2", "car3"};
                const auto before = f.left();
                f.link.ask(each.line.substr(0, each.line.find('{')) + " id=7");
                for (const auto& text : f.ways.texts_since(before)) { // a pool may be asked instead
                    BOOST_TEST(text.find(" north.") != std::string::npos, text);
                }
                BOOST_TEST(f.ways.count_bound() == 0U);
            }
        }
    }
}

// The right is needed when the request leaves, not only when it arrives.
BOOST_AUTO_TEST_CASE(a_right_that_ends_while_a_request_waits_counts) {
    for (const std::string line : {"PULL any:there", "PULL all:there", "BIND all:there"}) {
        BOOST_TEST_CONTEXT(line) {
            fixture f;
            f.routing->hold();
            BOOST_TEST(f.link.ask(line + " id=7").empty());
            f.security->forwarders = {};
            const auto before = f.left();
            f.routing->release(false);
            BOOST_TEST(f.left() == before);
            const auto reply = f.link.take();
            BOOST_TEST(reply.find("car1 may not forward requests of sat1") != std::string::npos, reply);
        }
    }
    {
        fixture f;
        BOOST_TEST(f.link.ask("BIND car2:there id=7").empty());
        f.security->forwarders = {};
        f.ways.bound("car2:there").binds("{}");
        const auto reply = f.link.take();
        BOOST_TEST(reply.find("car1 may not forward requests of sat1") != std::string::npos, reply);
        BOOST_TEST(f.ways.count_bound() == 0U);
    }
    fixture f;
    f.submit("DELEGATE car1:work id=7");
    f.security->forwarders = {};
    f.grant_to_car2();
    BOOST_TEST(f.queue.moved.empty());
}

BOOST_FIXTURE_TEST_CASE(a_right_that_ends_ends_the_bindings_that_it_permits, fixture) {
    link.ask("BIND car2:there id=7");
    ways.bound("car2:there").binds("{}");
    BOOST_TEST(link.session().serving().are_bindings_permitted());
    security->forwarders = {};
    BOOST_TEST(!link.session().serving().are_bindings_permitted());
    link.session().serving().drop_forbidden_bindings();
    BOOST_TEST(ways.count_bound() == 0U);
    security->forwarders = {"car1"};
    link.ask("BIND all:there id=8");
    ways.bound("car2:there").binds("{}");
    BOOST_TEST(link.session().serving().are_bindings_permitted());
    security->forwarders = {};
    BOOST_TEST(!link.session().serving().are_bindings_permitted());
}

BOOST_FIXTURE_TEST_CASE(a_binding_of_all_without_the_right_is_complete_when_the_right_is_given, fixture) {
    security->forwarders = {};
    node.open("there");
    BOOST_TEST(link.ask("BIND all:there id=7").starts_with(R"(id=7 {"results":{"car1":{}},"errors":{"car2":)"));
    BOOST_TEST(link.session().serving().are_bindings_permitted());
    security->forwarders = {"car1"};
    routing->on_rights_changed();
    BOOST_TEST(ways.bound("car2:there").text == "car2:there hops=7 via=car1 from=sat1");
}

BOOST_FIXTURE_TEST_CASE(what_is_asked_in_the_name_of_this_node_is_passed_on_as_such, fixture) {
    cles::test::test_link hub{node, "car3"};
    security->forwarders = {"car1", "car3"};
    hub.ask("PULL car2:there id=7 via=car3 from=car1");
    BOOST_TEST(ways.to("car2").text == "PULL car2:there hops=7 via=car3,car1 from=car1");
    security->denied = {"car1 PULL car2:there"};
    BOOST_TEST(hub.kind("PULL car2:there id=8 via=car3 from=car1") == "id=8 denied");
}

BOOST_AUTO_TEST_SUITE_END()
