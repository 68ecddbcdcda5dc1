// SPDX-License-Identifier: BSL-1.0
#include "node/membership/announcement.hpp"
#include "node/publish/multicast_group.hpp"
#include "node/secured/signed_announcer.hpp"
#include "support/group_recorder.hpp"
#include "support/scripted_security.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace secured_group {
namespace {

using cles::test::scripted_security;
using cles::test::source_at;

/// Counts what the node accepts.
struct admission final : cles::core::datagram_admission {
    bool accept(bool is_signed) override {
        ++(is_signed ? of_signed : of_others);
        return answer;
    }
    repetition accept_announcement(std::uint64_t seq) override {
        ++of_signed;
        if (!answer) {
            return repetition::refused;
        }
        const bool counts = seq > announced;
        announced = std::max(announced, seq);
        return counts ? repetition::first : repetition::again;
    }

    bool answer = true;
    std::uint64_t announced = 0; ///< the greatest `seq`
    int of_signed = 0;
    int of_others = 0;
};

struct announcements final : cles::core::announcement_listener {
    void on_solicitation(bool, cles::time_point) override { ++solicitations; }
    void on_announcement(cles::core::heard_announcement heard, cles::time_point) override {
        ++received;
        last = std::move(heard);
    }

    int solicitations = 0;
    int received = 0;
    cles::core::heard_announcement last;
};

struct fixture {
    fixture() {
        group.set_listener(&heard);
        node.open("pose");
    }
    ~fixture() { group.stop(); }
    fixture(const fixture&) = delete;
    fixture& operator=(const fixture&) = delete;

    /// A datagram of that member was opened.
    void hear(std::string_view member, std::string_view line, std::uint32_t epoch = 0x5f3a09c2,
              std::uint16_t port = 4001) {
        cles::protocol::request_line said;
        const bool valid = cles::protocol::parse_group_message(line, said);
        const auto from = source_at(port);
        session.on_datagram({.from = from,
                             .text = line,
                             .request = valid ? &said : nullptr,
                             .member = member,
                             .epoch = epoch,
                             .admission = &asked});
    }
    static std::string announcement(const std::string& name, const std::string& signer,
                                    const std::string& epoch = "5f3a09c2",
                                    const std::string& sources = R"("127.0.0.1:4001","127.0.0.1:4002")") {
        const auto body = R"({"node":")" + name + R"(","endpoints":[],"sources":[)" + sources +
                          R"(],"interval_ms":1000,"tasks":"d"})";
        return "UPDATE " + name + ":cles seq=5 epoch=" + epoch +
               " sig=" + scripted_security::signature(signer, "cles", 5, epoch, body) + " " + body;
    }

    /// car2 has announced itself.
    void know_car2(const cles::core::group_source& from = source_at(4001)) {
        cles::core::announcement known{.node = "car2", .endpoints = {"tls://10.0.0.3:1"}, .sources = {from}};
        known.original = std::make_shared<cles::core::signed_announcement>();
        node.host->peers.apply_announcement(known, 0x5f3a09c2, 17, from, node.host->time.now());
    }

    std::shared_ptr<scripted_security> security = std::make_shared<scripted_security>();
    cles::test::test_node node{{}, {}, {}, {}, security};
    cles::test::group_recorder port;
    cles::core::multicast_group group{node.host, 1};
    cles::core::group_session session{node.host, group, port.share(), 1};
    announcements heard;
    admission asked;
};

} // namespace
} // namespace secured_group

BOOST_FIXTURE_TEST_SUITE(secured_group, fixture)

BOOST_AUTO_TEST_CASE(an_announcement_counts_if_its_node_signed_it) {
    hear("car2", announcement("car2", "car2"));
    BOOST_TEST(heard.received == 1);
    BOOST_TEST(asked.of_signed == 1);
    hear("car2", announcement("car2", "car3"));
    BOOST_TEST(heard.received == 1);
    BOOST_TEST(node.counts().group_dropped == 1U);
}

BOOST_AUTO_TEST_CASE(an_announcement_of_another_member_does_not_count) {
    hear("car3", announcement("car2", "car2"));
    BOOST_TEST(heard.received == 0);
}

BOOST_AUTO_TEST_CASE(an_announcement_with_another_epoch_does_not_count) {
    hear("car2", announcement("car2", "car2", "5f3a09c1"));
    BOOST_TEST(heard.received == 0);
}

BOOST_AUTO_TEST_CASE(an_announcement_from_a_source_that_it_does_not_state_is_a_copy) {
    hear("car2", announcement("car2", "car2"), 0x5f3a09c2, 4666); // its epoch is not known
    BOOST_TEST(heard.received == 0);
    BOOST_TEST(asked.announced == 0U); // so the true one counts
    hear("car2", announcement("car2", "car2"));
    BOOST_TEST(heard.received == 1);
    know_car2();
    hear("car2", announcement("car2", "car2"), 0x5f3a09c2, 4666);
    BOOST_TEST(heard.received == 1);
    BOOST_TEST(node.counts().group_copied == 2U);
    BOOST_TEST(node.counts().group_dropped == 0U);
}

BOOST_AUTO_TEST_CASE(a_source_on_loopback_is_not_that_of_a_node_on_another_host) {
    const cles::core::group_source far{.address = 0x0A000003, .port = 4001};
    know_car2(far);
    hear("car2", announcement("car2", "car2", "5f3a09c2", R"("127.0.0.1:4001","10.0.0.3:4001")"));
    BOOST_TEST(heard.received == 0);
    BOOST_TEST(node.counts().group_copied == 1U);
}

BOOST_AUTO_TEST_CASE(one_that_states_no_sources_may_be_a_copy) {
    hear("car2", announcement("car2", "car2", "5f3a09c2", ""));
    BOOST_TEST(heard.received == 0);
    BOOST_TEST(node.counts().group_copied == 1U);
}

BOOST_AUTO_TEST_CASE(an_announcement_that_has_counted_is_a_repeat_by_its_seq) {
    hear("car2", announcement("car2", "car2"));
    BOOST_TEST(!heard.last.again);
    BOOST_TEST(heard.last.said.original->body.find("car2") != std::string::npos);
    hear("car2", announcement("car2", "car2"), 0x5f3a09c2, 4002); // by another interface, perhaps
    BOOST_TEST(heard.received == 2);
    BOOST_TEST(heard.last.again);
}

BOOST_AUTO_TEST_CASE(a_copy_of_another_line_does_not_keep_it_out) {
    know_car2();
    const std::string report = "UPDATE car2:cles/load seq=17 epoch=5f3a09c2 {\"queued\":3}";
    for (const auto& line :
         {report, std::string{"BIND all:cles"}, std::string{"UPDATE car2:pose seq=1 epoch=5f3a09c2 {}"}}) {
        hear("car2", line, 0x5f3a09c2, 4666);
    }
    BOOST_TEST(asked.of_others + asked.of_signed == 0); // their counters are not noted
    BOOST_TEST(heard.solicitations == 0);
    BOOST_TEST(node.counts().group_copied == 3U);
    hear("car2", report);
    BOOST_TEST(node.host->peers.find_member("car2")->load.queued == 3U);
    hear("car2", "BIND all:cles");
    BOOST_TEST(heard.solicitations == 1);
}

BOOST_AUTO_TEST_CASE(asking_needs_the_right_to_bind_here_whoever_is_asked) {
    for (const auto* target : {"all", "car1"}) {
        const auto ask = "BIND " + std::string{target} + ":cles";
        security->denied = {"car2 BIND car1:cles"};
        heard.solicitations = 0;
        hear("car2", ask);
        BOOST_TEST(heard.solicitations == 0, target);
        security->denied.clear();
        hear("car2", ask);
        BOOST_TEST(heard.solicitations == 1, target);
    }
    security->denied = {"car2 BIND car1:pose"};
    hear("car2", "BIND all:pose");
    static_cast<void>(port.take());
    node.publish_now("pose", "{}");
    BOOST_TEST(port.take().empty());
}

BOOST_AUTO_TEST_CASE(a_load_report_is_not_signed) {
    know_car2();
    const auto queued = [&] { return node.host->peers.find_member("car2")->load.queued; };
    const std::string report = "UPDATE car2:cles/load seq=17 epoch=5f3a09c2 {\"queued\":3}";
    hear("car3", report);
    hear("", report);
    hear("car2", report, 0x5f3a09c3);
    asked.answer = false; // a repeat
    hear("car2", report);
    asked.answer = true;
    for (const auto* wrong : {"cles/load/1 seq=17 epoch=5f3a09c2 {\"queued\":3}",
                              "cles/load seq=17 epoch=5f3a09c2 {\"queued\":", "cles/load seq=17 epoch=5f3a09c2 [3]",
                              "cles/load seq=17 epoch=5f3a09c2 {\"queued\":3} {}"}) {
        hear("car2", std::string{"UPDATE car2:"} + wrong);
    }
    BOOST_TEST(queued() == 0U);
    BOOST_TEST(node.counts().group_dropped == 8U);
    hear("car2", "UPDATE car2:cles/load seq=16 epoch=5f3a09c2 {\"queued\":3}");
    BOOST_TEST(queued() == 0U);
    BOOST_TEST(node.counts().announcements_dropped == 1U);
    asked.of_others = asked.of_signed = 0;
    hear("car2", report);
    BOOST_TEST(queued() == 3U);
    BOOST_TEST(node.counts().announcements_received == 1U);
    BOOST_TEST(asked.of_others == 1);
    BOOST_TEST(asked.of_signed == 0);
    BOOST_TEST(heard.received == 0);
}

BOOST_AUTO_TEST_CASE(a_repeat_does_not_count) {
    asked.answer = false;
    hear("car2", announcement("car2", "car2"));
    hear("car2", "BIND all:cles");
    BOOST_TEST(heard.received == 0);
    BOOST_TEST(heard.solicitations == 0);
}

BOOST_AUTO_TEST_CASE(members_look_for_others) {
    hear("car2", "BIND all:cles");
    BOOST_TEST(heard.solicitations == 1);
    BOOST_TEST(asked.of_others == 1);
    hear("car9", "BIND all:cles");
    hear("", "BIND all:cles");
    BOOST_TEST(heard.solicitations == 1);
}

BOOST_AUTO_TEST_CASE(a_binding_needs_the_right) {
    security->denied = {"car2 BIND car1:pose"};
    hear("car2", "BIND car1:pose");
    node.publish_now("pose", "{\"x\":1}");
    BOOST_TEST(port.take().empty());
    hear("car3", "BIND car1:pose");
    node.publish_now("pose", "{\"x\":2}");
    BOOST_TEST(!port.take().empty());
}

BOOST_AUTO_TEST_CASE(an_announcement_is_signed_with_the_version_of_the_roster) {
    const auto made = cles::core::sign_announcement(
        {.node = "car1", .endpoints = {"tls://10.0.0.2:25370"}, .roster = 7}, "cles", 17, "5f3a09c1", *security);
    std::string line;
    cles::core::append_announcement(line, "car1", *made, 17, "5f3a09c1");
    BOOST_TEST(line.ends_with("\n"));
    cles::protocol::request_line read;
    BOOST_REQUIRE(cles::protocol::parse_group_message(line, read));
    BOOST_TEST(security->is_signed("car1", "cles", 17, "5f3a09c1", read.body, read.sig));
    cles::core::announcement said;
    std::string why;
    BOOST_REQUIRE_MESSAGE(cles::core::read_announcement(read, said, why), why);
    BOOST_TEST(said.roster == 7U);
}

BOOST_AUTO_TEST_SUITE_END()
