// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "node/publish/multicast_group.hpp"
#include "support/group_recorder.hpp"
#include "support/scripted_security.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace signed_updates {
namespace {

using cles::verb;
using cles::test::scripted_security;
using cles::test::source_at;

constexpr std::string_view body = R"({"x":1})";

/// Records what a subscription receives.
class listener final : public cles::core::subscription {
  public:
    using subscription::subscription;
    std::vector<std::string> bodies;

  private:
    bool on_event(const cles::detail::raw_event& event, cles::core::feed_mailbox::hand_over) override {
        bodies.emplace_back(event.body);
        return true;
    }
};

struct admission final : cles::core::datagram_admission {
    bool accept(bool is_signed) override {
        ++(is_signed ? of_signed : of_others);
        return is_signed || answer;
    }
    repetition accept_announcement(std::uint64_t) override { return repetition::first; }

    bool answer = true;
    int of_signed = 0;
    int of_others = 0;
};

/// The node car1, with a link from sat1, and in the group.
struct fixture {
    fixture() {
        group.feeds().add(feed, node.clock.now());
        static_cast<void>(port.take());
        node.secured().confirmed().confirm("car2", {0x5f3a09c2}, node.clock.now());
    }
    ~fixture() { group.stop(); }
    fixture(const fixture&) = delete;
    fixture& operator=(const fixture&) = delete;

    void announce(const std::string& name, std::vector<std::string> tasks) {
        node.host->peers.apply_announcement({.node = name, .tasks = "d", .signed_tasks = std::move(tasks)}, 0x5f3a09c2,
                                            ++announced, source_at(4001), node.clock.now());
    }
    static std::string update(const std::string& publisher, int seq, const std::string& by = {},
                              std::string_view what = body) {
        const auto sig = by.empty() ? std::string{}
                                    : "sig=" +
                                          scripted_security::signature(by, "control", static_cast<std::uint64_t>(seq),
                                                                       "5f3a09c2", body) +
                                          " ";
        return "UPDATE " + publisher + ":control seq=" + std::to_string(seq) + " epoch=5f3a09c2 " + sig +
               std::string{what};
    }
    void hear(std::string_view line) {
        cles::protocol::request_line said;
        BOOST_REQUIRE(cles::protocol::parse_group_message(line, said));
        session.on_datagram({.from = source_at(4001),
                             .text = line,
                             .request = &said,
                             .member = said.noun.target,
                             .epoch = 0x5f3a09c2,
                             .admission = &asked});
    }
    [[nodiscard]] std::uint64_t refused() const { return node.counts().updates_unsigned; }
    [[nodiscard]] std::uint64_t received() const { return node.counts().updates_received; }

    std::shared_ptr<scripted_security> security = std::make_shared<scripted_security>();
    cles::test::test_node node{{}, {}, {}, {}, security};
    cles::test::test_link link{node, "sat1"};
    listener own{"sat1", "control", false, 16};
    listener relayed{"car2", "control", false, 16};
    cles::test::group_recorder port;
    cles::core::multicast_group group{node.host, 1};
    cles::core::group_session session{node.host, group, port.share(), 1};
    cles::core::group_feed feed{{}, node.host->completions, "all", "control"};
    admission asked;
    std::uint64_t announced = 0;
};

} // namespace
} // namespace signed_updates

BOOST_FIXTURE_TEST_SUITE(signed_updates, fixture)

BOOST_AUTO_TEST_SUITE(publishing)

BOOST_AUTO_TEST_CASE(the_line_contains_the_signature) {
    node.host->tasks.add(verb::bind, "control", {.info = {.must_be_signed = true}});
    link.ask("BIND car1:control/left id=1");
    node.publish_now("control/left", body);
    const auto sig = scripted_security::signature("car1", "control/left", 1, "5f3a09c1", body);
    BOOST_TEST(link.take() == "UPDATE car1:control/left seq=1 epoch=5f3a09c1 sig=" + sig + " {\"x\":1}\n");
    BOOST_TEST(node.host->published.find("control/left")->last_body() == body);
    BOOST_TEST(link.ask("BIND car1:control/left id=2 mark=yes") == "id=2 seq=1 epoch=5f3a09c1 {\"x\":1}\n");
}

BOOST_AUTO_TEST_CASE(one_verb_that_must_be_signed_is_enough) {
    node.host->tasks.add(verb::bind, "control", {});
    node.host->tasks.add(verb::pull, "control", {.info = {.must_be_signed = true}, .plain = [](const auto&, auto&) {}});
    link.ask("BIND car1:control id=1");
    node.publish_now("control", body);
    BOOST_TEST(link.take().find(" sig=") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(others_are_not_signed) {
    node.host->tasks.add(verb::bind, "control", {.info = {.must_be_signed = true}});
    node.open("pose");
    link.ask("BIND car1:pose id=1");
    node.publish_now("pose", body);
    BOOST_TEST(link.take() == "UPDATE car1:pose seq=1 epoch=5f3a09c1 {\"x\":1}\n");
}

BOOST_AUTO_TEST_CASE(a_node_without_security_publishes_none) {
    cles::test::test_node open;
    open.host->tasks.add(verb::bind, "control", {.info = {.must_be_signed = true}});
    BOOST_CHECK_EXCEPTION(open.publish("control", body), cles::error,
                          [](const cles::error& e) { return e.code() == cles::errc::denied; });
    BOOST_TEST(open.host->published.find("control") == nullptr);
}

BOOST_AUTO_TEST_CASE(the_size_of_the_names_is_limited) {
    const std::string name(64, 'a');
    for (char c = '1'; c <= '8'; ++c) {
        node.host->tasks.add(verb::bind, name.substr(1) + c, {.info = {.must_be_signed = true}});
    }
    BOOST_CHECK_EXCEPTION(node.host->tasks.add(verb::bind, "x", {.info = {.must_be_signed = true}}), cles::error,
                          [](const cles::error& e) { return e.code() == cles::errc::too_large; });
    BOOST_TEST(node.host->tasks.find(verb::bind, "x") == nullptr);
    node.host->tasks.add(verb::pull, name.substr(1) + '1', {.info = {.must_be_signed = true}}); // listed already
    BOOST_TEST(node.host->tasks.signed_tasks().size() == 8U);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(on_a_link)

BOOST_AUTO_TEST_CASE(the_publisher_itself_needs_no_announcement) {
    link.session().bound().add(own);
    link.ask(update("sat1", 1));
    link.ask(update("sat1", 2));
    link.ask(update("sat1", 3)); // its head is remembered by now
    BOOST_TEST(own.bodies.size() == 3U);
}

BOOST_AUTO_TEST_CASE(a_listed_task_needs_a_signature) {
    link.session().bound().add(own);
    announce("sat1", {"other", "control"});
    link.ask(update("sat1", 1));
    link.ask(update("sat1", 2, "car2"));
    link.ask(update("sat1", 3, "sat1", R"({"x":2})"));
    BOOST_TEST(own.bodies.empty());
    BOOST_TEST(refused() == 3U);
    link.ask(update("sat1", 4, "sat1"));
    BOOST_TEST(own.bodies.size() == 1U);
    BOOST_TEST(received() == 1U);
    link.ask(update("sat1", 4, "sat1"));
    BOOST_TEST(own.bodies.size() == 1U); // a repeat
}

BOOST_AUTO_TEST_CASE(one_that_becomes_listed_is_checked_from_then_on) {
    link.session().bound().add(own);
    for (int seq = 1; seq <= 3; ++seq) {
        link.ask(update("sat1", seq));
    }
    announce("sat1", {"control"});
    link.ask(update("sat1", 4));
    BOOST_TEST(own.bodies.size() == 3U);
    BOOST_TEST(refused() == 1U);
}

BOOST_AUTO_TEST_CASE(a_signature_that_is_not_needed_must_hold_too) {
    link.session().bound().add(own);
    link.ask(update("sat1", 1, "car2"));
    BOOST_TEST(refused() == 1U);
    link.ask(update("sat1", 2, "sat1"));
    BOOST_TEST(own.bodies.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_forwarded_one_without_an_announcement_counts_as_its_publisher_has_confirmed) {
    link.session().bound().add(relayed);
    link.ask(update("car2", 1));
    BOOST_TEST(relayed.bodies.size() == 1U);
    node.secured().confirmed().confirm("car2", {.epoch = 0x5f3a09c2, .signed_tasks = {"control"}}, node.clock.now());
    link.ask(update("car2", 2));
    link.ask(update("car2", 2, "sat1"));
    BOOST_TEST(refused() == 2U);
    link.ask(update("car2", 2, "car2"));
    BOOST_TEST(relayed.bodies.size() == 2U);
    announce("car2", {}); // it says so itself, and later
    link.ask(update("car2", 3));
    BOOST_TEST(relayed.bodies.size() == 3U);
}

BOOST_AUTO_TEST_CASE(what_another_instance_of_this_member_has_confirmed_counts) {
    listener same{"car1", "control", false, 16};
    link.session().bound().add(same);
    node.secured().confirmed().confirm("car1", {.epoch = 0x5f3a09c2, .signed_tasks = {"control"}}, node.clock.now());
    link.ask(update("car1", 1));
    BOOST_TEST(refused() == 1U);
    link.ask(update("car1", 2, "car1"));
    BOOST_TEST(same.bodies.size() == 1U);
}

BOOST_AUTO_TEST_CASE(what_the_peer_has_confirmed_of_an_earlier_epoch_does_not_count) {
    link.session().bound().add(own);
    node.secured().confirmed().confirm("sat1", {.epoch = 0x5f3a09c1, .signed_tasks = {"control"}}, node.clock.now());
    link.ask(update("sat1", 1));
    BOOST_TEST(own.bodies.size() == 1U);
    node.secured().confirmed().confirm("sat1", {.epoch = 0x5f3a09c2, .signed_tasks = {"control"}}, node.clock.now());
    link.ask(update("sat1", 2));
    BOOST_TEST(refused() == 1U);
}

BOOST_AUTO_TEST_CASE(a_forwarder_that_alters_it_is_noticed) {
    link.session().bound().add(relayed);
    announce("car2", {"control"});
    link.ask(update("car2", 1, "car2", R"({"x":2})"));
    link.ask(update("car2", 2));
    link.ask(update("car2", 3, "sat1"));
    BOOST_TEST(relayed.bodies.empty());
    BOOST_TEST(refused() == 3U);
    link.ask(update("car2", 4, "car2"));
    BOOST_TEST(relayed.bodies.size() == 1U);
}

BOOST_AUTO_TEST_CASE(one_that_nobody_wants_is_only_dropped) {
    announce("sat1", {"control"});
    link.ask(update("sat1", 1));
    BOOST_TEST(refused() == 0U);
    BOOST_TEST(node.counts().updates_dropped == 1U);
}

BOOST_AUTO_TEST_CASE(nothing_is_checked_without_security) {
    cles::test::test_node open;
    cles::test::test_link to{open};
    to.session().bound().add(relayed);
    to.ask(update("car2", 1, "sat1"));
    BOOST_TEST(relayed.bodies.size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(in_the_group)

BOOST_AUTO_TEST_CASE(a_publisher_must_have_announced_itself) {
    hear(update("car3", 1));
    BOOST_TEST(refused() == 1U);
    announce("car3", {});
    hear(update("car3", 2));
    BOOST_TEST(received() == 1U);
    BOOST_TEST(asked.of_others == 1);
    BOOST_TEST(asked.of_signed == 0);
}

BOOST_AUTO_TEST_CASE(a_listed_task_needs_a_signature) {
    announce("car2", {"control"});
    hear(update("car2", 1));
    hear(update("car2", 2, "car3"));
    BOOST_TEST(refused() == 2U);
    BOOST_TEST(received() == 0U);
    hear(update("car2", 3, "car2"));
    BOOST_TEST(received() == 1U);
}

BOOST_AUTO_TEST_CASE(or_have_confirmed_that_epoch) {
    hear(update("car2", 1));
    BOOST_TEST(received() == 1U);
    node.secured().confirmed().confirm("car2", {.epoch = 0x5f3a09c1}, node.clock.now());
    hear(update("car2", 2));
    BOOST_TEST(refused() == 1U);
    BOOST_TEST(received() == 1U);
}

BOOST_AUTO_TEST_CASE(only_its_seq_counts_then) {
    announce("car2", {"control"});
    asked.answer = false; // as if its counter had been used
    hear(update("car2", 1, "car2"));
    BOOST_TEST(received() == 1U);
    hear(update("car2", 1, "car2"));
    BOOST_TEST(received() == 1U);
    BOOST_TEST(node.counts().updates_dropped == 1U);
    BOOST_TEST(asked.of_others == 0);
}

BOOST_AUTO_TEST_CASE(others_count_once_by_their_counter) {
    announce("car2", {});
    asked.answer = false;
    hear(update("car2", 1));
    BOOST_TEST(received() == 0U);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
