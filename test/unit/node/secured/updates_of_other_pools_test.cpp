// SPDX-License-Identifier: BSL-1.0
// Updates of nodes of other pools in a secured fleet: announcements do not cross, so the publisher is asked whether it
// signs them (docs/federation.md, "Security"). car3 is a node of the pool north.
#include "node/secured/secured_link.hpp"
#include "support/group_recorder.hpp"
#include "support/scripted_security.hpp"
#include "support/session_fixture.hpp"
#include "support/told.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace updates_of_other_pools {
namespace {

using namespace std::chrono_literals;
using cles::test::numbers_feed;
using cles::test::scripted_security;

const std::string now_running = "0000000b";
const std::string later_running = "0000000c";

/// The link of car1 to the pool north.
class link_to_pool final : public cles::test::recording_line_sink, public cles::core::subscriber {
  public:
    explicit link_to_pool(cles::test::test_node& at)
        : recording_line_sink(0, std::make_shared<cles::core::memory_account>(at.host->memory)), at_(at),
          session_(at.host, *this, *this, peer_) {}

    std::string ask(std::string_view line) {
        session_.on_line(line, at_.clock.now());
        at_.pass(0ms); // what was held is delivered in a turn of its own
        return take();
    }
    [[nodiscard]] cles::core::session& session() { return session_; }
    [[nodiscard]] bool takes_updates() const override { return true; }
    void put_updates(std::string_view lines) override { output().append(lines); }

  private:
    cles::test::test_node& at_;
    cles::identity peer_{.transport = "pool", .address = "pool://north", .name = {}, .uid = {}, .local = false};
    cles::core::session session_;
};

struct fixture {
    fixture() {
        security->challenge = "AAAAAAAAAAAAAAAAAAAAAA";
        link.session().bound().add(feed);
    }

    static std::string update(int seq, const std::string& epoch = now_running, const std::string& signer = {},
                              const std::string& publisher = "north.car3") {
        const auto sig = signer.empty()
                             ? std::string{}
                             : " sig=" + scripted_security::signature(signer, "control",
                                                                      static_cast<std::uint64_t>(seq), epoch, "{}");
        return "UPDATE " + publisher + ":control seq=" + std::to_string(seq) + " epoch=" + epoch + sig + " {}";
    }
    /// car3 confirms its epoch, and lists this as the tasks whose updates it signs: R"("control")".
    [[nodiscard]] std::string confirmation(int id, const std::string& epoch, const std::string& tasks,
                                           const std::string& node = "car3", const std::string& by = "car3") const {
        const auto said = R"({"node":")" + node + R"(","endpoints":[],"signed":[)" + tasks + "]}";
        return "id=" + std::to_string(id) + R"( {"announced":)" + said + R"(,"seq":2,"epoch":")" + epoch +
               R"(","sig":")" +
               scripted_security::signature(by, "cles/announced/" + security->challenge, 2, epoch, said) + "\"}";
    }
    [[nodiscard]] static bool is_question(const std::string& sent) {
        return sent.starts_with("PULL north.car3:cles/announced/AAAAAAAAAAAAAAAAAAAAAA id=");
    }
    [[nodiscard]] std::uint64_t refused() const { return node.counts().updates_unsigned; }

    std::shared_ptr<scripted_security> security = std::make_shared<scripted_security>();
    cles::test::test_node node{{}, {}, {}, {}, security};
    link_to_pool link{node};
    numbers_feed feed{"north.car3", "control", false, 8};
};

const std::string control = R"("control")";

} // namespace
} // namespace updates_of_other_pools

BOOST_FIXTURE_TEST_SUITE(updates_of_other_pools, fixture)

BOOST_AUTO_TEST_CASE(they_are_held_until_their_publisher_has_answered) {
    const auto sent = link.ask(update(1));
    BOOST_TEST(is_question(sent), sent);
    BOOST_TEST(link.ask(update(2)).empty()); // asked already
    BOOST_TEST(feed.heard.empty());
    link.ask(confirmation(1, now_running, R"("other")"));
    BOOST_TEST(feed.heard == "1 2 ");
    BOOST_TEST(link.ask(update(3)).empty());
    BOOST_TEST(feed.heard == "1 2 3 ");
    BOOST_TEST(refused() == 0U);
    BOOST_TEST(node.counts().updates_received == 3U);
}

BOOST_AUTO_TEST_CASE(a_listed_task_needs_the_publishers_signature) {
    link.ask(update(1));
    link.ask(update(2, now_running, "car2"));
    link.ask(update(3, now_running, "north.car3"));
    link.ask(update(4, now_running, "car3")); // under its name in the fleet
    BOOST_TEST(feed.heard.empty());
    BOOST_TEST(refused() == 0U);
    link.ask(confirmation(1, now_running, control));
    BOOST_TEST(feed.heard == "4 ");
    BOOST_TEST(refused() == 3U);
    // From then on, at once.
    BOOST_TEST(link.ask(update(5)).empty());
    BOOST_TEST(link.ask(update(6, now_running, "car2")).empty());
    BOOST_TEST(refused() == 5U);
    link.ask(update(7, now_running, "car3"));
    BOOST_TEST(feed.heard == "4 gap 7 ");
}

BOOST_AUTO_TEST_CASE(a_signature_that_is_not_needed_must_hold_too) {
    link.ask(update(1, now_running, "car2"));
    link.ask(update(2, now_running, "car3"));
    link.ask(confirmation(1, now_running, {}));
    BOOST_TEST(feed.heard == "2 ");
    BOOST_TEST(refused() == 1U);
}

BOOST_AUTO_TEST_CASE(only_the_publisher_itself_can_answer) {
    link.ask(update(1));
    link.ask(confirmation(1, now_running, {}, "car3", "car2"));
    node.pass(1s);
    BOOST_TEST(is_question(link.ask(update(2))));
    link.ask(confirmation(2, now_running, {}, "car2", "car2"));
    node.pass(1s);
    BOOST_TEST(is_question(link.ask(update(3))));
    link.ask(R"(id=3 {"error":"no_target","message":"north.car3 is gone"})");
    BOOST_TEST(feed.heard.empty());
    BOOST_TEST(node.counts().updates_dropped == 3U);
    BOOST_TEST(node.secured().confirmed().find("north.car3") == nullptr);
}

BOOST_AUTO_TEST_CASE(each_incarnation_says_what_it_signs) {
    link.ask(update(1));
    link.ask(confirmation(1, now_running, {}));
    BOOST_TEST(feed.heard == "1 ");
    node.pass(2s);
    BOOST_TEST(is_question(link.ask(update(1, later_running))));
    link.ask(confirmation(2, later_running, control));
    BOOST_TEST(feed.heard == "1 ");
    BOOST_TEST(refused() == 1U);
    link.ask(update(2, later_running, "car3"));
    BOOST_TEST(feed.heard == "1 2 ");
}

BOOST_AUTO_TEST_CASE(one_that_signs_no_more_is_heard_after_its_restart) {
    link.ask(update(1, now_running, "car3"));
    link.ask(confirmation(1, now_running, control));
    BOOST_TEST(feed.heard == "1 ");
    node.pass(2s);
    BOOST_TEST(is_question(link.ask(update(1, later_running))));
    link.ask(confirmation(2, later_running, {}));
    BOOST_TEST(feed.heard == "1 1 ");
    BOOST_TEST(refused() == 0U);
}

BOOST_AUTO_TEST_CASE(a_name_without_the_pool_is_asked_for_as_it_is) {
    numbers_feed plain{"car3", "control", false, 8};
    link.session().bound().add(plain);
    const auto sent = link.ask(update(1, now_running, {}, "car3"));
    BOOST_TEST(sent.starts_with("PULL car3:cles/announced/"), sent);
    link.ask(confirmation(1, now_running, {}));
    BOOST_TEST(plain.heard == "1 ");
}

BOOST_AUTO_TEST_CASE(an_announcement_at_home_counts_before_what_was_confirmed) {
    const auto must = [this] { return node.secured().must_be_signed("car3", "control"); };
    BOOST_TEST(!must().has_value());
    node.secured().confirmed().confirm("car3", {.epoch = 0xB, .signed_tasks = std::vector<std::string>{"control"}},
                                       node.clock.now());
    BOOST_TEST(must().value());
    BOOST_TEST(!node.secured().must_be_signed("car3", "other").value());
    BOOST_TEST(!node.secured().must_be_signed("north.car3", "control").has_value());
    const auto announce = [this](std::uint64_t seq, std::vector<std::string> tasks) {
        node.host->peers.apply_announcement({.node = "car3", .tasks = "d", .signed_tasks = std::move(tasks)}, 0xB, seq,
                                            cles::test::source_at(4001), node.clock.now());
    };
    announce(1, {});
    BOOST_TEST(!must().value());
    node.secured().confirmed().confirm("car3", {.epoch = 0xB, .signed_tasks = std::vector<std::string>{}},
                                       node.clock.now());
    announce(2, {"control"});
    BOOST_TEST(must().value());
}

BOOST_AUTO_TEST_SUITE_END()
