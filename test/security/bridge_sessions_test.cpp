// SPDX-License-Identifier: BSL-1.0
#include "security/keys/bytes.hpp"
#include "security/messages/bridge_sessions.hpp"
#include "security/sealed_network.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace sessions_of_bridges {
namespace {

using namespace std::chrono_literals;
using namespace cles::security;
using namespace cles::security::test;
using cles::time_point;
using sessions_of_bridge = cles::security::bridge_sessions;
using verdict = sessions_of_bridge::verdict;

const std::string subject = "cles.b.bridge.0000020000000002.request";
const std::string reply_to = "cles.a.bridge.0000010000000001.7";

// A bridge of a member, during one connection to NATS.
struct end_of_session {
    seeded_entropy random;
    fleet known;
    sessions_of_bridge sessions{known, random};
    std::uint64_t instance;
    std::vector<std::uint8_t> opened{};

    end_of_session(const test_fleet& of, int car, std::uint64_t seed)
        : random(seed), known(test_fleet::name_of(car), test_fleet::key_of(car), of.authority.share()),
          instance(static_cast<std::uint64_t>(car) << 40U | seed) {}

    void adopt(const test_fleet& of) { static_cast<void>(known.offer(of.authority.newest().line())); }
};

// Draws what the test vectors have drawn.
class drawn_before final : public entropy {
  public:
    void add(const std::vector<std::uint8_t>& drawn) { left_.insert(left_.end(), drawn.begin(), drawn.end()); }
    void fill(std::span<std::uint8_t> out) override {
        if (out.size() > left_.size()) {
            throw std::runtime_error{"the vectors have drawn less"};
        }
        std::copy_n(left_.begin(), out.size(), out.begin());
        left_.erase(left_.begin(), left_.begin() + static_cast<std::ptrdiff_t>(out.size()));
    }

  private:
    std::vector<std::uint8_t> left_;
};

struct two_ends {
    test_fleet fleet{3};
    end_of_session car1{fleet, 1, 101};
    end_of_session car2{fleet, 2, 102};
    time_point now{1h};

    two_ends() {
        car1.sessions.note_able(car2.instance, "two", now);
        car2.sessions.note_able(car1.instance, "one", now);
    }
    [[nodiscard]] std::string hello(end_of_session& from, const end_of_session& to) const {
        return from.sessions.hello_if_due(from.instance, to.instance, now);
    }
    [[nodiscard]] std::string answer(end_of_session& by, const end_of_session& to, std::string_view text) const {
        return by.sessions.take_hello(by.instance, to.instance, text, now);
    }
    // Begins a session in which `from` can send.
    void begin(end_of_session& from, end_of_session& to) const {
        const auto welcome = answer(to, from, hello(from, to));
        BOOST_REQUIRE(!welcome.empty());
        from.sessions.take_welcome(to.instance, welcome);
    }
    [[nodiscard]] std::string seal(end_of_session& from, const end_of_session& to, std::string_view message) const {
        return from.sessions.seal(from.instance, to.instance, subject, reply_to, message, now);
    }
    [[nodiscard]] verdict open(end_of_session& by, std::string_view sealed, std::string_view on = subject,
                               std::string_view reply = reply_to) const {
        const auto head = sessions_of_bridge::read_head(as_bytes(sealed));
        return head ? by.sessions.open(*head, on, reply, as_bytes(sealed), by.opened, now) : verdict::refused;
    }
};

} // namespace

BOOST_FIXTURE_TEST_SUITE(bridge_sessions, two_ends)

BOOST_AUTO_TEST_CASE(the_vectors_are_made_and_opened) {
    const auto& vector = vectors().at("pool_session").as_object();
    const auto& instances = vector.at("instances").as_array();
    const auto& secrets = vector.at("ephemeral_secrets").as_array();
    const auto instance = [&](std::size_t which) {
        return std::stoull(boost::json::value_to<std::string>(instances.at(which)), nullptr, 16);
    };
    const auto secret = [&](std::size_t which) {
        return from_hex(boost::json::value_to<std::string>(secrets.at(which)));
    };
    drawn_before initiator_draws;
    initiator_draws.add(from_hex(text_at(vector, "hello_index")));
    initiator_draws.add(secret(0));
    drawn_before responder_draws;
    responder_draws.add(from_hex(text_at(vector, "index")));
    responder_draws.add(secret(1));
    cles::security::fleet of_car1{"car1", vector_key("car1"), reread(text_at(vectors(), "roster"))};
    cles::security::fleet of_car2{"car2", vector_key("car2"), reread(text_at(vectors(), "roster"))};
    sessions_of_bridge initiator{of_car1, initiator_draws};
    sessions_of_bridge responder{of_car2, responder_draws};
    initiator.note_able(instance(1), "two", now);
    responder.note_able(instance(0), "one", now);
    const auto first = initiator.hello_if_due(instance(0), instance(1), now);
    BOOST_TEST(("hello " + first) == text_at(vector, "hello"));
    const auto second = responder.take_hello(instance(1), instance(0), first, now);
    BOOST_TEST(("welcome " + second) == text_at(vector, "welcome"));
    initiator.take_welcome(instance(1), second);
    const auto on = text_at(vector, "subject");
    const auto answer_to = text_at(vector, "reply");
    const auto sealed = initiator.seal(instance(0), instance(1), on, answer_to, text_at(vector, "message"), now);
    BOOST_TEST(to_hex(as_bytes(sealed)) == text_at(vector, "sealed"));
    const auto head = sessions_of_bridge::read_head(as_bytes(sealed));
    BOOST_REQUIRE(head.has_value());
    std::vector<std::uint8_t> opened;
    BOOST_TEST((responder.open(*head, on, answer_to, as_bytes(sealed), opened, now) == verdict::opened));
    BOOST_TEST(as_text(opened) == text_at(vector, "message"));
}

BOOST_AUTO_TEST_CASE(each_end_sends_in_the_session_that_it_has_begun) {
    begin(car1, car2);
    BOOST_TEST(seal(car2, car1, "back").empty());
    begin(car2, car1);
    const auto there = seal(car1, car2, "PULL car2:speed");
    const auto back = seal(car2, car1, "");
    BOOST_TEST(there.size() == 15 + sessions_of_bridge::overhead);
    BOOST_TEST(back.size() == sessions_of_bridge::overhead);
    BOOST_TEST(!contains(there, "speed"));
    BOOST_TEST((open(car2, there) == verdict::opened));
    BOOST_TEST(as_text(car2.opened) == "PULL car2:speed");
    BOOST_TEST((open(car1, back) == verdict::opened));
    BOOST_TEST(car1.opened.empty());
    BOOST_TEST((open(car1, seal(car1, car2, "x")) == verdict::unknown)); // its own
}

BOOST_AUTO_TEST_CASE(nothing_begins_with_a_bridge_that_has_none) {
    end_of_session car3{fleet, 3, 103};
    car3.sessions.note_able(car1.instance, "one", now);
    BOOST_TEST(!car1.sessions.is_able(car3.instance));
    BOOST_TEST(hello(car1, car3).empty());
    BOOST_TEST(answer(car1, car3, hello(car3, car1)).empty());
    BOOST_TEST(car1.sessions.begin_again(car1.instance, car3.instance, now).empty());
    BOOST_TEST(car1.sessions.questions_of(car3.instance).empty());
}

BOOST_AUTO_TEST_CASE(no_bit_of_a_message_can_be_changed) {
    begin(car1, car2);
    const auto sealed = seal(car1, car2, "{}");
    for (std::size_t place = 0; place < sealed.size(); ++place) {
        for (unsigned bit = 0; bit < 8; ++bit) {
            auto changed = sealed;
            changed[place] = static_cast<char>(static_cast<unsigned char>(changed[place]) ^ (1U << bit));
            BOOST_TEST((open(car2, changed) != verdict::opened));
        }
        BOOST_TEST((open(car2, sealed.substr(0, place)) != verdict::opened));
    }
    BOOST_TEST((open(car2, sealed + "x") == verdict::refused));
    BOOST_TEST((open(car2, sealed, "cles.b.bridge.0000020000000002.control") == verdict::refused));
    BOOST_TEST((open(car2, sealed, subject, "") == verdict::refused));
    BOOST_TEST((open(car2, sealed) == verdict::opened));
}

BOOST_AUTO_TEST_CASE(each_counter_counts_once) {
    begin(car1, car2);
    std::vector<std::string> sealed;
    for (int i = 0; i < 1026; ++i) {
        sealed.push_back(seal(car1, car2, "x"));
    }
    BOOST_TEST((open(car2, sealed[1]) == verdict::opened));
    BOOST_TEST((open(car2, sealed[0]) == verdict::opened)); // in another order
    BOOST_TEST((open(car2, sealed[0]) == verdict::refused));
    BOOST_TEST((open(car2, sealed[1]) == verdict::refused));
    BOOST_TEST((open(car2, sealed[1025]) == verdict::opened));
    BOOST_TEST((open(car2, sealed[2]) == verdict::opened));
    BOOST_TEST((open(car2, seal(car1, car2, "x")) == verdict::opened));
    BOOST_TEST((open(car2, seal(car1, car2, "x")) == verdict::opened));
    BOOST_TEST((open(car2, sealed[3]) == verdict::refused)); // 1024 late
}

BOOST_AUTO_TEST_CASE(a_handshake_is_of_two_bridges_and_one_hello) {
    end_of_session car3{fleet, 3, 103};
    end_of_session again{fleet, 2, 202}; // another connection of car2
    for (auto* const each : {&car3, &again}) {
        each->sessions.note_able(car1.instance, "one", now);
        car1.sessions.note_able(each->instance, "other", now);
    }
    const auto to_car2 = hello(car1, car2);
    BOOST_TEST(answer(car3, car1, to_car2).empty());
    BOOST_TEST(answer(again, car1, to_car2).empty());
    BOOST_TEST(answer(car2, car3, to_car2).empty());
    const auto welcome = answer(car2, car1, to_car2);
    BOOST_TEST(!hello(car1, again).empty());
    car1.sessions.take_welcome(again.instance, welcome);
    BOOST_TEST(seal(car1, again, "x").empty());
    auto changed = welcome;
    changed[40] = changed[40] == 'A' ? 'B' : 'A';
    for (const auto& wrong : {changed, welcome.substr(1), welcome + "A", std::string{}}) {
        car1.sessions.take_welcome(car2.instance, wrong);
        BOOST_TEST(seal(car1, car2, "x").empty(), wrong);
    }
    car1.sessions.take_welcome(car2.instance, welcome); // forged ones have not kept it out
    BOOST_TEST((open(car2, seal(car1, car2, "x")) == verdict::opened));
    for (const auto& wrong : {to_car2.substr(1), to_car2 + "A", std::string{}, std::string(75, 'A')}) {
        BOOST_TEST(answer(car2, car1, wrong).empty(), wrong);
    }
}

BOOST_AUTO_TEST_CASE(hello_is_repeated_until_it_is_answered) {
    const auto first = hello(car1, car2);
    BOOST_TEST(first.size() == 75U);
    BOOST_TEST(hello(car1, car2).empty());
    now += 200ms;
    BOOST_TEST(hello(car1, car2) == first);
    BOOST_TEST(car1.sessions.begin_again(car1.instance, car2.instance, now) == first); // at once
    const auto welcome = answer(car2, car1, first);
    BOOST_TEST(welcome.size() == 86U);
    BOOST_TEST(answer(car2, car1, first) == welcome); // the first answer was lost
    now += 10s;
    const auto second = hello(car1, car2);
    BOOST_TEST(!second.empty());
    BOOST_TEST(second != first);
    car1.sessions.take_welcome(car2.instance, welcome); // too late
    BOOST_TEST(seal(car1, car2, "x").empty());
    car1.sessions.take_welcome(car2.instance, answer(car2, car1, second));
    BOOST_TEST((open(car2, seal(car1, car2, "x")) == verdict::opened));
    now += 1s;
    BOOST_TEST(hello(car1, car2).empty());
}

BOOST_AUTO_TEST_CASE(an_old_session_is_replaced_and_ends) {
    begin(car1, car2);
    now += 15min;
    const auto sealed = seal(car1, car2, "before");
    const auto next = hello(car1, car2);
    BOOST_REQUIRE(!next.empty());
    const auto last = seal(car1, car2, "while it is replaced");
    car1.sessions.take_welcome(car2.instance, answer(car2, car1, next));
    BOOST_TEST((open(car2, seal(car1, car2, "after")) == verdict::opened));
    BOOST_TEST((open(car2, sealed) == verdict::opened));
    now += 5min;
    BOOST_TEST((open(car2, last) == verdict::unknown));
    now += 15min;
    BOOST_TEST(seal(car1, car2, "x").empty());
}

BOOST_AUTO_TEST_CASE(the_newest_sessions_of_a_bridge_count) {
    begin(car1, car2);
    const auto sealed = seal(car1, car2, "x");
    for (std::size_t i = 0; i < sessions_of_bridge::most_received; ++i) {
        BOOST_TEST((open(car2, seal(car1, car2, "x")) == verdict::opened));
        now += 1s;
        car1.sessions.take_welcome(car2.instance,
                                   answer(car2, car1, car1.sessions.begin_again(car1.instance, car2.instance, now)));
    }
    BOOST_TEST((open(car2, sealed) == verdict::unknown));
}

BOOST_AUTO_TEST_CASE(a_session_ends_that_the_other_end_does_not_know) {
    begin(car1, car2);
    car2.sessions.end_sessions(car1.instance);
    const auto sealed = seal(car1, car2, "x");
    BOOST_TEST((open(car2, sealed) == verdict::unknown));
    const auto index = sessions_of_bridge::read_head(as_bytes(sealed))->index;
    car1.sessions.end_unknown(car2.instance, index + 1); // of another one
    BOOST_TEST(!seal(car1, car2, "x").empty());
    car1.sessions.end_unknown(car2.instance, index);
    BOOST_TEST(seal(car1, car2, "x").empty());
    BOOST_TEST(hello(car1, car2).empty()); // too soon
    now += 200ms;
    begin(car1, car2);
    BOOST_TEST(!car1.sessions.begin_again(car1.instance, car2.instance, now).empty()); // at once
    BOOST_TEST(seal(car1, car2, "x").empty());
    now += 200ms;
    begin(car1, car2);
    BOOST_TEST((open(car2, seal(car1, car2, "x")) == verdict::opened));
}

BOOST_AUTO_TEST_CASE(a_bridge_that_is_lost_has_to_begin_again) {
    begin(car1, car2);
    const auto sealed = seal(car1, car2, "x");
    car2.sessions.end_sessions(car1.instance);
    BOOST_TEST((open(car2, sealed) == verdict::unknown));
    car1.sessions.end_sessions(car2.instance);
    BOOST_TEST(seal(car1, car2, "x").empty());
    BOOST_TEST((car1.sessions.is_able(car2.instance) && car2.sessions.is_able(car1.instance))); // nothing is signed
    BOOST_TEST(car1.sessions.questions_of(car2.instance) == "two");
    begin(car1, car2); // at once
    BOOST_TEST((open(car2, seal(car1, car2, "x")) == verdict::opened));
}

BOOST_AUTO_TEST_CASE(a_removed_member_has_no_session) {
    begin(car1, car2);
    begin(car2, car1);
    const auto sealed = seal(car1, car2, "x");
    fleet.remove(1);
    car2.adopt(fleet);
    BOOST_TEST((open(car2, sealed) == verdict::unknown));
    BOOST_TEST(seal(car2, car1, "x").empty());
    car1.adopt(fleet); // it is the one that is removed
    BOOST_TEST(seal(car1, car2, "x").empty());
    BOOST_TEST(!car1.sessions.is_able(car2.instance));
}

BOOST_AUTO_TEST_CASE(sessions_outlast_a_roster_with_the_same_members) {
    begin(car1, car2);
    const auto sealed = seal(car1, car2, "x");
    fleet.authority.rotate();
    fleet.remove(3);
    car1.adopt(fleet);
    car2.adopt(fleet);
    BOOST_TEST((open(car2, sealed) == verdict::opened));
    BOOST_TEST((open(car2, seal(car1, car2, "x")) == verdict::opened));
}

BOOST_AUTO_TEST_CASE(a_member_uses_up_its_own_space_only) {
    end_of_session car3{fleet, 3, 103};
    car1.sessions.note_able(car3.instance, "three", now);
    for (std::uint64_t i = 0; i < sessions_of_bridge::most_of_member; ++i) {
        BOOST_TEST(car1.sessions.is_able(car2.instance));
        car1.sessions.note_able(std::uint64_t{2} << 40U | (1000 + i), "two", now);
    }
    BOOST_TEST(!car1.sessions.is_able(car2.instance)); // the first one
    BOOST_TEST(car1.sessions.is_able(car3.instance));
}

BOOST_AUTO_TEST_CASE(the_bridge_of_a_member_is_forgotten_that_was_silent_for_longest) {
    for (std::uint64_t i = 0; i < 2 * sessions_of_bridge::most_of_member; ++i) {
        car1.sessions.note_able(std::uint64_t{2} << 40U | (1000 + i), "two", now);
        car1.sessions.note_able(car2.instance, "two", now); // goes on
    }
    begin(car1, car2);
    car1.sessions.note_able(std::uint64_t{2} << 40U | 2000U, "two", now);
    BOOST_TEST(!seal(car1, car2, "x").empty());
}

BOOST_AUTO_TEST_CASE(a_member_uses_up_its_own_share_of_hello) {
    end_of_session car3{fleet, 3, 103};
    car3.sessions.note_able(car2.instance, "two", now);
    car2.sessions.note_able(car3.instance, "three", now);
    const auto text = hello(car1, car2);
    int answered = 0;
    while (!answer(car2, car1, text).empty()) {
        BOOST_REQUIRE(++answered < 1000);
    }
    BOOST_TEST(answered >= 8);
    BOOST_TEST(!answer(car2, car3, hello(car3, car2)).empty());
    now += 1s;
    BOOST_TEST(!answer(car2, car1, text).empty());
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace sessions_of_bridges
