// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/fleet.hpp"
#include "security/fleet_fixture.hpp"
#include "security/link_admission.hpp"

#include <boost/test/data/monomorphic.hpp>
#include <boost/test/data/test_case.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace link_admission {
namespace {

using namespace cles::security;
using namespace cles::security::test;
using namespace std::chrono_literals;
using admission_class = cles::security::link_admission;
using verdict = admission_class::verdict;
using reason = admission_class::reason;

constexpr std::string_view hello = R"(PUSH self:cles/hello reply=no {"version":3,"epoch":"5f3a09c1"})";
constexpr std::string_view welcome = "PUSH self:cles/welcome reply=no";

// One end of a link: a node, what it has sent and not delivered yet, and its decision.
struct end {
    end(std::string_view name, std::shared_ptr<const roster> known, std::string epoch, std::string expected = {})
        : end(name, name, std::move(known), std::move(epoch), std::move(expected)) {}
    end(std::string_view name, std::string_view key, std::shared_ptr<const roster> known, std::string epoch,
        std::string expected = {})
        : own_key(key_of(key).public_part()), terms(std::make_shared<admission_terms>()) {
        terms->fleet = std::make_shared<fleet>(std::string{name}, key_of(key), std::move(known));
        terms->epoch = std::move(epoch);
        admission = std::make_unique<admission_class>(terms, std::move(expected));
    }

    [[nodiscard]] std::uint32_t version() const { return terms->fleet->in_force().version(); }
    // The next line that it has sent, without its LF; empty if there is none.
    std::string take_line() {
        const auto length = out.find('\n');
        auto line = out.substr(0, length);
        out.erase(0, length == std::string::npos ? length : length + 1);
        return line;
    }
    verdict receive(std::string_view line) { return decision = admission->on_line(line, out); }

    public_key own_key;
    std::shared_ptr<admission_terms> terms;
    std::unique_ptr<admission_class> admission;
    std::string out{};
    std::vector<std::string> sent{};
    verdict decision = verdict::pending;
};

// Delivers what `from` has sent. Nothing arrives after a refusal.
void deliver(end& from, end& to) {
    while (!from.out.empty()) {
        const auto line = from.take_line();
        from.sent.push_back(line);
        if (to.decision == verdict::pending) {
            BOOST_TEST(line.size() <= to.admission->max_line());
            to.receive(line);
        }
    }
}

void begin(end& one, end& other) {
    one.admission->begin(other.own_key, one.out);
    other.admission->begin(one.own_key, other.out);
}

void connect(end& one, end& other) {
    begin(one, other);
    while (!one.out.empty() || !other.out.empty()) {
        deliver(one, other);
        deliver(other, one);
    }
}

bool sends_roster(const end& by) {
    return std::ranges::any_of(by.sent, [](const auto& line) { return contains(line, "cles/roster"); });
}

struct fixture {
    fleet_authority authority = authority_with({"car1", "car2"}); // version 3
    std::shared_ptr<const roster> old_roster = authority.share();

    end car1() { return {"car1", authority.share(), "5f3a09c1"}; }
    end car2(std::string expected = {}) { return {"car2", authority.share(), "00000002", std::move(expected)}; }
    // car1, after it has received the other end's hello.
    std::unique_ptr<end> greeted() {
        auto made = std::make_unique<end>(car1());
        made->admission->begin(key_of("car2").public_part(), made->out);
        made->receive(hello);
        made->out.clear();
        return made;
    }
};

} // namespace
} // namespace link_admission

BOOST_FIXTURE_TEST_SUITE(link_admission, fixture)

BOOST_AUTO_TEST_CASE(members_admit_each_other) {
    auto one = car1();
    auto other = car2();
    connect(one, other);
    BOOST_TEST((one.decision == verdict::admitted));
    BOOST_TEST((other.decision == verdict::admitted));
    BOOST_TEST(one.admission->name() == "car2");
    BOOST_TEST(one.admission->number() == 2U);
    BOOST_TEST(one.admission->epoch() == "00000002");
    BOOST_TEST(other.admission->name() == "car1");
    BOOST_TEST(other.admission->epoch() == "5f3a09c1");
    BOOST_TEST((one.sent == std::vector<std::string>{std::string{hello}, std::string{welcome}}));
}

BOOST_AUTO_TEST_CASE(the_newer_roster_passes_to_the_end_that_lacks_it) {
    authority.rotate();
    for (const bool swapped : {false, true}) {
        end older{"car1", old_roster, "00000001"};
        auto newer = car2();
        if (swapped) {
            connect(newer, older);
        } else {
            connect(older, newer);
        }
        BOOST_TEST((older.decision == verdict::admitted));
        BOOST_TEST((newer.decision == verdict::admitted));
        BOOST_TEST(older.version() == authority.newest().version());
        BOOST_TEST(!sends_roster(older));
        BOOST_TEST(newer.sent.size() == 3U);
        BOOST_TEST(newer.sent[1] == "PUSH self:cles/roster reply=no " + authority.newest().line());
    }
}

BOOST_AUTO_TEST_CASE(an_old_roster_shuts_out_no_newer_member) {
    authority.add(node("car3"));
    end older{"car1", old_roster, "00000001"};
    end newcomer{"car3", authority.share(), "00000003"};
    connect(older, newcomer);
    BOOST_TEST((older.decision == verdict::admitted));
    BOOST_TEST((newcomer.decision == verdict::admitted));
    BOOST_TEST(older.admission->name() == "car3");
}

BOOST_AUTO_TEST_CASE(a_removed_member_is_told_from_a_stranger) {
    auto member = car1();
    authority.remove("car2");
    member.terms->fleet->offer(authority.newest().line());
    authority.rotate();
    member.terms->fleet->offer(authority.newest().line());
    auto removed = car2();
    connect(member, removed);
    BOOST_TEST((member.decision == verdict::refused));
    BOOST_TEST((member.admission->refused_for() == reason::removed));
    BOOST_TEST(member.admission->why() == "car2 was removed from the fleet: its key is not in roster 5");
    BOOST_TEST(contains(removed.admission->why(), "the key of this node is not in roster 5")); // as strangers are told
    authority.add(node("car2"));
    member.terms->fleet->offer(authority.newest().line());
    auto again = car1();
    again.terms->fleet->offer(authority.newest().line());
    auto returned = car2();
    connect(again, returned);
    BOOST_TEST((again.decision == verdict::admitted));
}

BOOST_AUTO_TEST_CASE(a_stranger_is_denied_and_gets_no_roster) {
    auto member = car1();
    auto founded = fleet_authority::found(key_of("fleet"));
    end stranger{"spy", founded.share(), "00000009"}; // with an older version
    connect(member, stranger);
    BOOST_TEST((member.decision == verdict::refused));
    BOOST_TEST((member.admission->refused_for() == reason::not_member));
    BOOST_TEST(!sends_roster(member));
    BOOST_TEST(member.sent.back() == R"({"error":"denied","message":"the key of this node is not in roster 3"})");
    BOOST_TEST((stranger.decision == verdict::refused));
    BOOST_TEST((stranger.admission->refused_for() == reason::by_peer));
    BOOST_TEST(contains(stranger.admission->why(), "not in roster 3"));
}

BOOST_AUTO_TEST_CASE(a_key_counts_and_not_a_name) {
    auto member = car1();
    end impostor{"car2", "another key", fleet_authority::found(key_of("fleet")).share(), "00000009"};
    connect(member, impostor);
    BOOST_TEST((member.decision == verdict::refused));
}

BOOST_AUTO_TEST_CASE(a_removed_member_is_denied_by_the_newer_roster_and_does_not_get_it) {
    authority.remove("car1");
    end removed{"car1", old_roster, "00000001"};
    auto member = car2();
    connect(removed, member);
    BOOST_TEST((removed.decision == verdict::refused));
    BOOST_TEST((member.decision == verdict::refused));
    BOOST_TEST(!sends_roster(member));
    BOOST_TEST(removed.version() == old_roster->version());
}

BOOST_AUTO_TEST_CASE(a_removed_member_that_has_the_newer_roster_is_denied_by_those_that_have_not) {
    authority.remove("car1");
    end removed{"car1", authority.share(), "00000001"};
    end member{"car2", old_roster, "00000002"};
    connect(removed, member);
    BOOST_TEST((member.decision == verdict::refused));
    BOOST_TEST((removed.decision == verdict::refused));
    BOOST_TEST(member.version() == authority.newest().version());
}

BOOST_AUTO_TEST_CASE(two_rosters_of_one_version_do_not_pass) {
    fleet_authority branch{key_of("fleet"), authority.share()};
    branch.add(node("car3"));
    authority.add(node("car4"));
    end one{"car1", authority.share(), "00000001"};
    end other{"car2", branch.share(), "00000002"};
    connect(one, other);
    BOOST_TEST((one.decision == verdict::admitted));
    BOOST_TEST((other.decision == verdict::admitted));
    BOOST_TEST(!sends_roster(one));
    BOOST_TEST(!sends_roster(other));
}

BOOST_AUTO_TEST_CASE(a_roster_of_another_fleet_is_refused) {
    auto foreign = fleet_authority::found(key_of("another fleet"));
    foreign.add(node("car1"));
    foreign.add(node("car2"));
    foreign.rotate();
    auto member = car1();
    end other{"car2", foreign.share(), "00000002"};
    connect(member, other);
    BOOST_TEST((member.decision == verdict::refused));
    BOOST_TEST((other.decision == verdict::refused));
    BOOST_TEST(contains(member.admission->why(), "roster was refused"));
    BOOST_TEST(member.version() == 3U);
}

BOOST_AUTO_TEST_CASE(another_name_than_expected_ends_the_link_without_a_word) {
    auto one = car1();
    auto other = car2("car3");
    connect(one, other);
    BOOST_TEST((other.decision == verdict::refused));
    BOOST_TEST((other.admission->refused_for() == reason::other_name));
    BOOST_TEST(other.admission->why() == "the other end is car1, not car3");
    BOOST_TEST(other.sent.size() == 1U); // its hello
    BOOST_TEST((one.decision == verdict::pending));
}

BOOST_AUTO_TEST_CASE(the_expected_name_is_admitted) {
    auto one = car1();
    auto other = car2("car1");
    connect(one, other);
    BOOST_TEST((other.decision == verdict::admitted));
}

BOOST_AUTO_TEST_CASE(a_roster_may_have_arrived_by_another_link_meanwhile) {
    authority.rotate();
    end older{"car1", old_roster, "00000001"};
    auto newer = car2();
    begin(older, newer);
    deliver(newer, older); // the hello
    older.terms->fleet->offer(authority.newest().line());
    authority.rotate();
    newer.terms->fleet->offer(authority.newest().line());
    deliver(older, newer);
    while (!older.out.empty() || !newer.out.empty()) {
        deliver(newer, older);
        deliver(older, newer);
    }
    BOOST_TEST((older.decision == verdict::admitted));
    BOOST_TEST((newer.decision == verdict::admitted));
    BOOST_TEST(older.version() == authority.newest().version());
}

BOOST_AUTO_TEST_CASE(a_member_that_is_removed_before_the_welcome_is_not_admitted) {
    const auto made = greeted();
    authority.remove("car2");
    made->terms->fleet->offer(authority.newest().line());
    BOOST_TEST((made->receive(welcome) == verdict::refused));
    BOOST_TEST((made->admission->refused_for() == reason::not_member));
}

BOOST_AUTO_TEST_CASE(an_admission_is_in_force_as_long_as_both_are_the_same_members) {
    authority.add(node("car3"));
    const auto admit = [&] {
        auto made = std::make_unique<end>("car1", authority.share(), "00000001");
        auto other = car2();
        connect(*made, other);
        BOOST_REQUIRE((made->decision == verdict::admitted));
        BOOST_TEST(made->admission->is_in_force());
        return made;
    };
    const auto one = admit();
    authority.remove("car3");
    one->terms->fleet->offer(authority.newest().line());
    BOOST_TEST(one->admission->is_in_force());

    authority.remove("car2");
    one->terms->fleet->offer(authority.newest().line());
    BOOST_TEST(!one->admission->is_in_force());
    authority.add(node("car2")); // with another number: another member
    one->terms->fleet->offer(authority.newest().line());
    BOOST_TEST(!one->admission->is_in_force());

    const auto itself = admit();
    authority.remove("car1");
    itself->terms->fleet->offer(authority.newest().line());
    BOOST_TEST(!itself->admission->is_in_force());
}

// -- what the other end may send -----------------------------------------------------------------------------------

namespace {

const auto unexpected_lines = boost::unit_test::data::make(
    {"", "PULL self:cles", "PUSH self:cles/hello {\"version\":3,\"epoch\":\"5f3a09c1\"}",
     "PUSH self:cles/hello id=1 reply=no {\"version\":3,\"epoch\":\"5f3a09c1\"}",
     "PUSH car1:cles/hello reply=no {\"version\":3,\"epoch\":\"5f3a09c1\"}", "PUSH self:cles/roster reply=no {}",
     "PUSH self:cles/roster/1 reply=no {}", "PUSH self:cles reply=no", "PUSH self:cles/goodbye reply=no",
     "PULL self:cles/hello reply=no", "UPDATE car2:cles seq=1 epoch=5f3a09c1 {}", "{}", "id=1 {}", "GET / HTTP/1.1",
     "\x16\x03\x01"});

} // namespace

BOOST_DATA_TEST_CASE_F(fixture, any_other_line_instead_of_the_hello_ends_the_link, unexpected_lines, line) {
    auto one = car1();
    one.admission->begin(key_of("car2").public_part(), one.out);
    BOOST_TEST((one.receive(line) == verdict::refused));
    BOOST_TEST((one.admission->refused_for() == reason::protocol));
    BOOST_TEST(!one.admission->why().empty());
}

BOOST_DATA_TEST_CASE_F(fixture, any_other_line_instead_of_the_welcome_ends_the_link, unexpected_lines, line) {
    const auto one = greeted();
    BOOST_TEST((one->receive(line) == verdict::refused));
    BOOST_TEST((one->admission->refused_for() == reason::protocol));
}

BOOST_AUTO_TEST_CASE(the_lines_have_one_order) {
    auto early = car1();
    early.admission->begin(key_of("car2").public_part(), early.out);
    BOOST_TEST((early.receive(welcome) == verdict::refused));
    BOOST_TEST((greeted()->receive(hello) == verdict::refused));
    BOOST_TEST((greeted()->receive(welcome) == verdict::admitted));

    auto lacks_roster = car1();
    lacks_roster.admission->begin(key_of("car2").public_part(), lacks_roster.out);
    lacks_roster.receive(R"(PUSH self:cles/hello reply=no {"version":4,"epoch":"5f3a09c1"})");
    BOOST_TEST((lacks_roster.decision == verdict::pending));
    BOOST_TEST((lacks_roster.receive(welcome) == verdict::refused));
}

BOOST_DATA_TEST_CASE_F(
    fixture, a_malformed_hello_ends_the_link,
    boost::unit_test::data::make({"", "{}", "[]", R"({"version":3})", R"({"epoch":"5f3a09c1"})",
                                  R"({"version":0,"epoch":"5f3a09c1"})", R"({"version":-1,"epoch":"5f3a09c1"})",
                                  R"({"version":4294967296,"epoch":"5f3a09c1"})",
                                  R"({"version":3.0,"epoch":"5f3a09c1"})", R"({"version":3e0,"epoch":"5f3a09c1"})",
                                  R"({"version":"3","epoch":"5f3a09c1"})", R"({"version":3,"epoch":"5F3A09C1"})",
                                  R"({"version":3,"epoch":"5f3a09c"})", R"({"version":3,"epoch":1})",
                                  R"({"version":3,"epoch":"5f3a09c1"} x)", R"({"version":3,"epoch":"5f3a09c1")"}),
    body) {
    auto one = car1();
    one.admission->begin(key_of("car2").public_part(), one.out);
    BOOST_TEST((one.receive("PUSH self:cles/hello reply=no " + std::string{body}) == verdict::refused));
    BOOST_TEST((one.admission->refused_for() == reason::protocol));
}

BOOST_AUTO_TEST_CASE(further_keys_of_a_hello_are_ignored) {
    auto one = car1();
    one.admission->begin(key_of("car2").public_part(), one.out);
    one.receive(R"(PUSH self:cles/hello reply=no {"new":[1],"epoch":"5f3a09c1","version":3,"x":{}})");
    BOOST_TEST((one.decision == verdict::pending));
    BOOST_TEST((one.receive(welcome) == verdict::admitted));
}

BOOST_AUTO_TEST_CASE(a_refusal_is_quoted_without_control_characters_and_not_for_long) {
    const auto one = greeted();
    one->receive(R"({"error":"denied","message":"no\u001b[2J )" + std::string(5000, 'x') + "\"}");
    BOOST_TEST((one->decision == verdict::refused));
    BOOST_TEST((one->admission->refused_for() == reason::by_peer));
    BOOST_TEST(contains(one->admission->why(), "no\\u001b[2J xxx"));
    BOOST_TEST(one->admission->why().size() < 300U);
}

// -- limits --------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_long_line_is_permitted_only_for_a_roster_that_was_announced) {
    auto one = car1();
    one.admission->begin(key_of("car2").public_part(), one.out);
    BOOST_TEST(one.admission->max_line() == 1024U);
    one.receive(R"(PUSH self:cles/hello reply=no {"version":4,"epoch":"5f3a09c1"})");
    BOOST_TEST(one.admission->max_line() == 1'000'031U);
    authority.rotate();
    one.receive("PUSH self:cles/roster reply=no " + authority.newest().line());
    BOOST_TEST((one.decision == verdict::pending));
    BOOST_TEST(one.admission->max_line() == 1024U);
    BOOST_TEST(greeted()->admission->max_line() == 1024U);
}

namespace {

// A link from a host, whose other end has an unknown key and states a roster that is far newer.
struct claim {
    claim(const std::shared_ptr<admission_terms>& terms, std::string_view host, std::string_view key = "unknown")
        : admission(terms, {}, host) {
        admission.on_displaced([this](std::string_view line) { displaced = line; });
        admission.begin(key_of(key).public_part(), out);
        out.clear();
        result = admission.on_line(R"(PUSH self:cles/hello reply=no {"version":4000000000,"epoch":"5f3a09c1"})", out);
    }
    verdict send_part(std::size_t size) { return result = admission.on_part(size, out); }

    admission_class admission;
    std::string out{};
    std::string displaced{};
    verdict result{};
};

} // namespace

BOOST_AUTO_TEST_CASE(a_stated_version_uses_up_nothing) {
    auto member = car1();
    std::vector<std::unique_ptr<claim>> strangers;
    for (int i = 0; i < 1000; ++i) {
        auto& made = *strangers.emplace_back(std::make_unique<claim>(member.terms, "10.0.0.66"));
        BOOST_TEST((made.result == verdict::pending));
        BOOST_TEST((made.send_part(i < 500 ? 0 : admission_terms::short_roster) == verdict::pending));
    }
    BOOST_TEST(member.terms->rosters_of_strangers.size() == 0U);
    authority.add(node("car3"));
    end newcomer{"car3", authority.share(), "00000003"};
    connect(member, newcomer);
    BOOST_TEST((member.decision == verdict::admitted));
}

BOOST_AUTO_TEST_CASE(long_rosters_of_unknown_keys_are_limited_by_what_has_arrived) {
    constexpr std::size_t is_long = admission_terms::long_rosters / 16;
    const auto shared = car1().terms;
    std::vector<std::unique_ptr<claim>> open;
    const auto send_long = [&](std::string_view host, std::string_view key = "unknown") -> claim& {
        auto& made = *open.emplace_back(std::make_unique<claim>(shared, host, key));
        made.send_part(is_long);
        return made;
    };
    for (int i = 0; i < 16; ++i) {
        BOOST_TEST((send_long("10.0.0.1").result == verdict::pending));
    }
    auto& refused = send_long("10.0.0.1");
    BOOST_TEST((refused.result == verdict::refused));
    BOOST_TEST((refused.admission.refused_for() == reason::busy));
    BOOST_TEST(refused.out.starts_with(R"({"error":"busy")"));
    BOOST_TEST((send_long("10.0.0.1", "car2").result == verdict::pending)); // a member

    BOOST_TEST((send_long("10.0.0.2").result == verdict::pending)); // another address, which has fewer
    BOOST_TEST(open[0]->displaced.starts_with(R"({"error":"busy")"));
    BOOST_TEST((open[0]->admission.refused_for() == reason::busy));
    BOOST_TEST(open[1]->displaced.empty());
    BOOST_TEST(shared->rosters_of_strangers.size() == 16U);
    BOOST_TEST((open.back()->send_part(is_long) == verdict::pending)); // counts once
    BOOST_TEST((open.back()->send_part(is_long + 1) == verdict::pending));
    BOOST_TEST(shared->rosters_of_strangers.size() == 15U);
    BOOST_TEST(open[1]->displaced.starts_with(R"({"error":"busy")"));
    BOOST_TEST((open[2]->send_part(2 * is_long) == verdict::refused)); // its address has the most

    BOOST_TEST((send_long("10.0.0.1").result == verdict::pending));
    BOOST_TEST((send_long("10.0.0.1").result == verdict::refused));
    open.erase(open.begin() + 3); // its link ends
    BOOST_TEST((send_long("10.0.0.1").result == verdict::pending));
    std::string out;
    open[3]->admission.on_line("something else", out);
    BOOST_TEST((send_long("10.0.0.1").result == verdict::pending));
    open.clear();
    BOOST_TEST(shared->rosters_of_strangers.size() == 0U);
    BOOST_TEST(shared->rosters_of_strangers.amount() == 0U);
}

BOOST_AUTO_TEST_CASE(a_network_of_64_bits_counts_as_one_address) {
    const auto shared = car1().terms;
    std::vector<std::unique_ptr<claim>> open;
    for (int i = 0; i < 16; ++i) {
        open.push_back(std::make_unique<claim>(shared, "2001:db8::" + std::to_string(i + 1)));
        BOOST_TEST((open.back()->send_part(1'000'000) == verdict::pending));
    }
    claim more{shared, "2001:db8::ffff"};
    BOOST_TEST((more.send_part(1'000'000) == verdict::refused));
    claim elsewhere{shared, "2001:db8:0:1::1"};
    BOOST_TEST((elsewhere.send_part(1'000'000) == verdict::pending));
}

BOOST_AUTO_TEST_CASE(handshakes_of_members_do_not_count) {
    cles::time_point now{1h};
    auto member = car1();
    for (int i = 0; i < 5000; ++i) {
        admission_class link{member.terms, {}, "10.0.0.2"};
        BOOST_REQUIRE(link.take_handshake(now));
        std::string out;
        link.begin(key_of("car2").public_part(), out);
        link.on_line(hello, out);
        BOOST_REQUIRE((link.on_line(welcome, out) == verdict::admitted));
    }
    int taken = 0;
    for (int i = 0; i < 5000; ++i) {
        admission_class link{member.terms, {}, "10.0.0.66"};
        taken += link.take_handshake(now) ? 1 : 0;
    }
    BOOST_TEST(taken == 4 + 256);
    admission_class late{member.terms, {}, "10.0.0.66"};
    BOOST_TEST(!late.take_handshake(now));
    BOOST_TEST((late.refused_for() == reason::busy));
    admission_class other{member.terms, {}, "10.0.0.67"};
    BOOST_TEST(other.take_handshake(now));
}

// 200 addresses open 2,000 links a second, take part in the handshake, and send a long roster that never ends.
// Meanwhile, new members bring newer rosters.
BOOST_AUTO_TEST_CASE(a_flood_of_strangers_keeps_out_no_member_that_brings_a_newer_roster) {
    struct stranger {
        cles::time_point until;
        std::unique_ptr<claim> link;
    };
    cles::time_point now{1h};
    auto member = car1();
    std::deque<stranger> strangers; // each link has five seconds to open
    int number = 0;
    int admitted = 0;
    constexpr int newcomers = 100;
    const auto flood = [&](std::chrono::microseconds span) {
        for (const auto until = now + span; now < until; now += 500us, ++number) {
            const auto host = "10.0.1." + std::to_string(number % 200);
            auto made = std::make_unique<claim>(member.terms, host);
            if (made->admission.take_handshake(now) && made->send_part(20'000) == verdict::pending) {
                strangers.push_back({now + 5s, std::move(made)});
            }
            while (!strangers.empty() && strangers.front().until <= now) {
                strangers.pop_front();
            }
        }
    };
    for (int i = 0; i < newcomers; ++i) {
        flood(100ms);
        const auto name = "new" + std::to_string(i);
        authority.add(node(name));
        claim newcomer{member.terms, "10.0.2." + std::to_string(i % 4), name};
        const bool begun = newcomer.admission.take_handshake(now);
        for (const std::size_t size : {20'000, 60'000, 100'000}) { // its roster arrives within 15 ms
            newcomer.send_part(size);
            flood(5ms);
        }
        if (begun && newcomer.displaced.empty() && newcomer.result == verdict::pending) {
            newcomer.admission.on_line("PUSH self:cles/roster reply=no " + authority.newest().line(), newcomer.out);
            admitted += newcomer.admission.on_line(welcome, newcomer.out) == verdict::admitted ? 1 : 0;
        }
    }
    BOOST_TEST(admitted >= newcomers * 99 / 100);
}

BOOST_AUTO_TEST_SUITE_END()
