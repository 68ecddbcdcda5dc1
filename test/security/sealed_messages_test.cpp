// SPDX-License-Identifier: BSL-1.0
#include "security/child_process.hpp"
#include "security/keys/bytes.hpp"
#include "security/messages/sealed_messages.hpp"
#include "security/sealed_network.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sodium.h>

namespace messages {
namespace {

using namespace std::chrono_literals;
using namespace cles::security;
using namespace cles::security::test;
using cles::time_point;
using cles::core::message_seal;
using verdict = message_seal::verdict;

// A message as NATS carries it, with what its subjects state of its sender.
struct carried {
    std::string subject;
    std::string reply;
    std::uint64_t instance = 0;
    std::string questions;
    std::string bytes;

    bool is_update = false;

    [[nodiscard]] message_seal::origin from() const {
        return {.instance = instance == 0 ? std::nullopt : std::optional{instance},
                .questions = questions,
                .is_update = is_update};
    }
};

// A bridge of a member, during one connection to NATS.
struct bridge {
    seeded_entropy random;
    fleet known;
    std::vector<std::string> rosters; // that were received
    sealed_messages messages;
    std::string questions;
    int heartbeats = 0; // that are due

    bridge(const test_fleet& of, int car, std::uint64_t seed, std::uint64_t first_counter = 0)
        : bridge(of.authority.share(), car, seed, first_counter) {}
    bridge(std::shared_ptr<const roster> initial, int car, std::uint64_t seed, std::uint64_t first_counter = 0)
        : random(seed), known(test_fleet::name_of(car), test_fleet::key_of(car), std::move(initial)),
          messages(
              known, random,
              [this](std::string_view line) {
                  rosters.emplace_back(line);
                  static_cast<void>(known.offer(line));
              },
              first_counter),
          questions("cles.pool" + std::to_string(car) + ".bridge." + std::to_string(messages.instance()) + ".seal") {}

    void adopt(const test_fleet& of) { static_cast<void>(known.offer(of.authority.newest().line())); }
    carried send(std::string_view message, std::string_view subject = "cles.a.beat.1", std::string_view reply = {}) {
        return {.subject = std::string{subject},
                .reply = std::string{reply},
                .instance = messages.instance(),
                .questions = questions,
                .bytes = messages.seal(subject, reply, message)};
    }
    std::vector<carried> take_questions() {
        std::vector<carried> taken;
        for (auto& each : messages.take_questions(questions)) {
            taken.push_back({.subject = std::move(each.subject),
                             .reply = questions,
                             .instance = messages.instance(),
                             .questions = questions,
                             .bytes = std::move(each.message)});
        }
        return taken;
    }
};

struct three_bridges {
    test_fleet fleet{3};
    bridge car1{fleet, 1, 101};
    bridge car2{fleet, 2, 102};
    bridge car3{fleet, 3, 103};
    time_point now{1h};
    std::vector<carried> exchanged; // questions and answers

    message_seal::opened_message open(bridge& by, const carried& message) const {
        return by.messages.open(message.subject, message.reply, message.from(), message.bytes, now);
    }
    // Whether a message has an effect.
    bool takes(bridge& by, const carried& message) const { return open(by, message).what == verdict::opened; }
    bool refuses(bridge& by, const carried& message) const {
        const auto result = open(by, message);
        return result.what == verdict::refused && result.message.empty() && result.sender.empty() &&
               !result.why.empty() && by.take_questions().empty();
    }
    // NATS delivers a message to those that have its subject.
    bool on_question(bridge& by, const carried& message) const {
        return message.subject == by.questions &&
               by.messages.on_question(message.subject, message.from(), message.bytes, now);
    }
    // Delivers the questions of all and the answers to them.
    template <class... Bridges>
    void settle(Bridges&... all) {
        const std::vector<bridge*> ends{&all...};
        for (bool any = true; any;) {
            any = false;
            for (auto* const sender : ends) {
                for (auto& each : sender->take_questions()) {
                    any = true;
                    for (auto* const receiver : ends) {
                        if (receiver->questions == each.subject) {
                            receiver->heartbeats += on_question(*receiver, each) ? 1 : 0;
                        }
                    }
                    exchanged.push_back(std::move(each));
                }
            }
        }
    }
    // Both can open what the other sends from now on.
    void meet(bridge& one, bridge& other) {
        BOOST_REQUIRE((open(one, other.send("hello")).what == verdict::unproven));
        BOOST_REQUIRE((open(other, one.send("hello")).what == verdict::unproven));
        settle(one, other);
        BOOST_REQUIRE((takes(one, other.send("hello")) && takes(other, one.send("hello"))));
    }
};

bool is_ask(const carried& message) { return message.bytes.starts_with('\x86'); }
bool is_roster(const carried& message) { return message.bytes.starts_with('\x87'); }

// A POOL message made by a member that has the group key and may do with it what it likes.
struct forged {
    std::uint32_t member = 1;
    int signed_by = 1;
    group_salt salt{};
    std::uint64_t counter = 1;
    std::uint32_t generation = 1;

    [[nodiscard]] std::string seal(const bridge& insider, std::string_view subject, std::string_view reply,
                                   std::string_view message) const {
        bytes head(group_head_bytes);
        write_group_head(member, generation, salt, counter, head.data());
        head[0] = 0x85;
        const auto text_of = [](const auto& from) { return std::string(from.begin(), from.end()); };
        const auto additional = text_of(head).append(subject).append("\n").append(reply);
        const auto text =
            "cles pool 1\n" + text_of(insider.known.in_force().fleet()) + additional + "\n" + std::string{message};
        const auto plain = text_of(test_fleet::key_of(signed_by).sign(text)) + std::string{message};
        std::string sealed(plain.size() + 16, '\0');
        crypto_aead_xchacha20poly1305_ietf_encrypt(reinterpret_cast<std::uint8_t*>(sealed.data()), nullptr,
                                                   reinterpret_cast<const std::uint8_t*>(plain.data()), plain.size(),
                                                   reinterpret_cast<const std::uint8_t*>(additional.data()),
                                                   additional.size(), nullptr, head.data() + 8,
                                                   insider.known.ring().find(generation)->data());
        return text_of(head) + sealed;
    }
};

} // namespace

BOOST_FIXTURE_TEST_SUITE(sealed_messages, three_bridges)

BOOST_AUTO_TEST_CASE(the_vectors_are_opened) {
    seeded_entropy random{1};
    cles::security::fleet known{"car1", vector_key("car1"), reread(text_at(vectors(), "roster"))};
    std::vector<std::string> rosters;
    cles::security::sealed_messages reader{known, random,
                                           [&rosters](std::string_view line) { rosters.emplace_back(line); }};
    const message_seal::origin car2_states{.instance = std::stoull(vector_text("pool", "instance"), nullptr, 16),
                                           .questions = "car2"};
    const auto sealed = from_hex(vector_text("pool", "sealed"));
    const auto result =
        reader.open(vector_text("pool", "subject"), vector_text("pool", "reply"), car2_states, as_text(sealed), now);
    BOOST_REQUIRE((result.what == verdict::unproven));
    BOOST_TEST(result.sender == "car2");
    BOOST_TEST(result.message == vector_text("pool", "message"));
    reader.on_stated_roster(car2_states, 8, now);
    const auto asked = reader.take_questions("car1");
    BOOST_REQUIRE(asked.size() == 2U);
    BOOST_TEST(to_hex(as_bytes(asked[1].message)) == vector_text("ask", "message"));
    const auto given = from_hex(vector_text("given_roster", "message"));
    BOOST_TEST(!reader.on_question("car1", car2_states, as_text(given), now));
    BOOST_REQUIRE(rosters.size() == 1U);
    BOOST_TEST(rosters[0] == text_at(vectors(), "roster"));
}

BOOST_AUTO_TEST_CASE(the_vector_is_made) {
    cles::security::test::fixed_salt random{from_hex(vector_text("pool", "salt"))};
    cles::security::fleet known{"car2", vector_key("car2"), reread(text_at(vectors(), "roster"))};
    cles::security::sealed_messages writer{
        known, random, {}, vectors().at("pool").at("counter").to_number<std::uint64_t>()};
    BOOST_TEST(to_hex(as_bytes(writer.seal(vector_text("pool", "subject"), vector_text("pool", "reply"),
                                           vector_text("pool", "message")))) == vector_text("pool", "sealed"));
    BOOST_TEST(writer.instance() == std::stoull(vector_text("pool", "instance"), nullptr, 16));
}

BOOST_AUTO_TEST_CASE(a_message_is_opened_by_who_knows_that_its_sender_is_alive) {
    meet(car1, car2);
    const auto sealed = car1.send("PULL car2:speed {}", "cles.b.pull.car2.speed", "cles.a.reply.1");
    BOOST_TEST(sealed.bytes.size() == 18 + message_seal::overhead);
    BOOST_TEST(!contains(sealed.bytes, "speed"));
    const auto result = open(car2, sealed);
    BOOST_REQUIRE((result.what == verdict::opened));
    BOOST_TEST(result.sender == "car1");
    BOOST_TEST(result.message == "PULL car2:speed {}");
    BOOST_TEST(result.why.empty());
    BOOST_TEST(open(car2, car1.send("")).message.empty());
    const std::string long_one(1'000'000, 'x');
    BOOST_TEST((open(car2, car1.send(long_one)).message == long_one));
}

BOOST_AUTO_TEST_CASE(a_bridge_opens_what_it_sends_to_itself) {
    const auto sealed = car1.send("heartbeat");
    BOOST_TEST(open(car1, sealed).message == "heartbeat");
    BOOST_TEST(!takes(car1, sealed));
    BOOST_TEST(car1.take_questions().empty());
}

BOOST_AUTO_TEST_CASE(an_instance_is_the_members_number_and_the_beginning_of_the_salt) {
    const auto sealed = car2.send("");
    BOOST_TEST((car2.messages.instance() >> 40U) == 2U);
    const auto salt = to_hex(bytes(sealed.bytes.begin() + 8, sealed.bytes.begin() + 13));
    BOOST_TEST((car2.messages.instance() & 0xFF'FFFF'FFFFU) == std::stoull(salt, nullptr, 16));
    BOOST_TEST((bridge{fleet, 2, 104}.messages.instance() != car2.messages.instance()));
}

// -- what is refused -----------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(no_bit_of_a_message_can_be_changed) {
    meet(car1, car2);
    const auto sealed = car1.send("PULL car2:speed", "cles.b.pull", "cles.a.reply.1");
    std::size_t accepted = 0;
    for (std::size_t bit = 0; bit < sealed.bytes.size() * 8; ++bit) {
        auto changed = sealed;
        changed.bytes[bit / 8] = static_cast<char>(changed.bytes[bit / 8] ^ 1 << bit % 8);
        accepted += open(car2, changed).what == verdict::refused ? 0 : 1;
    }
    BOOST_TEST(accepted == 0U);
    BOOST_TEST(takes(car2, sealed)); // those that were changed do not keep it out
}

BOOST_AUTO_TEST_CASE(a_message_that_is_cut_or_longer_is_refused) {
    meet(car1, car2);
    const auto sealed = car1.send("ask AAAAAAAAAAAAAAAAAAAAAA", car2.questions, car1.questions);
    BOOST_REQUIRE(sealed.bytes.size() == 138U);
    for (std::size_t length = 0; length <= 150; ++length) {
        auto other = sealed;
        other.bytes.resize(length);
        if (length != sealed.bytes.size()) {
            BOOST_TEST(refuses(car2, other), "length " << length);
            BOOST_TEST(!on_question(car2, other), "length " << length);
        }
    }
    BOOST_TEST(car2.take_questions().empty());
    BOOST_TEST(on_question(car2, sealed));
}

BOOST_AUTO_TEST_CASE(a_message_counts_on_its_subject_only) {
    meet(car1, car2);
    const auto sealed = car1.send("PUSH", "cles.b.push.x", "cles.a.reply.1");
    for (const auto& [subject, reply] :
         std::vector<std::pair<std::string, std::string>>{{"cles.b.push.y", "cles.a.reply.1"},
                                                          {"cles.b.push.x", "cles.a.reply.2"},
                                                          {"cles.b.push.x", ""},
                                                          {"", "cles.a.reply.1"},
                                                          {"cles.a.reply.1", "cles.b.push.x"},
                                                          {"cles.b.push.x\ncles.a.reply.1", ""}}) {
        auto moved = sealed;
        moved.subject = subject;
        moved.reply = reply;
        BOOST_TEST(refuses(car2, moved), subject << ", " << reply);
    }
    BOOST_TEST(takes(car2, sealed));
}

BOOST_AUTO_TEST_CASE(no_subject_has_two_readings) {
    meet(car1, car2);
    BOOST_TEST(car1.messages.seal("a\nb", "c", "m").empty());
    BOOST_TEST(car1.messages.seal("a", "b\nc", "m").empty());
    // An insider signs one message and moves the end of its subject for replies into it, or out of it.
    const forged own{.salt = {1}, .counter = 9};
    const auto bytes = own.seal(car1, "a", "b\nc", "m");
    BOOST_TEST((car2.messages.open("a", "b\nc", {}, bytes, now).what == verdict::refused));
}

BOOST_AUTO_TEST_CASE(a_member_cannot_pose_as_another_one) {
    meet(car1, car3);
    forged posing{.member = 1, .signed_by = 2, .counter = 100};
    std::copy_n(car1.send("").bytes.begin() + 8, posing.salt.size(), posing.salt.begin());
    carried sent{.subject = "cles.a.beat.1", .bytes = posing.seal(car2, "cles.a.beat.1", "", "I am car1")};
    BOOST_TEST(refuses(car3, sent));
    posing.signed_by = 1; // the same, in truth of car1
    sent.bytes = posing.seal(car2, "cles.a.beat.1", "", "I am car1");
    BOOST_TEST(takes(car3, sent));
}

BOOST_AUTO_TEST_CASE(a_member_cannot_seal_again_what_another_one_has_signed) {
    meet(car1, car3);
    meet(car2, car3);
    const auto sealed = car1.send("PUSH", "cles.c.push.x");
    // car2 opens it and has the signature of car1, which holds for this head only.
    const auto head = read_group_head(reinterpret_cast<const std::uint8_t*>(sealed.bytes.data()));
    const forged original{.member = 1, .salt = head.salt, .counter = head.counter};
    BOOST_REQUIRE(original.seal(car2, "cles.c.push.x", "", "PUSH") == sealed.bytes);
    auto plain = [&](forged with, std::string_view subject) {
        // Seals under another head, with the signature of the original one.
        bytes other(group_head_bytes);
        write_group_head(with.member, with.generation, with.salt, with.counter, other.data());
        other[0] = 0x85;
        const auto* const key = car2.known.ring().find(1);
        const std::string original_additional = sealed.bytes.substr(0, 32) + "cles.c.push.x\n";
        bytes opened(sealed.bytes.size() - 48);
        BOOST_REQUIRE(crypto_aead_xchacha20poly1305_ietf_decrypt(
                          opened.data(), nullptr, nullptr,
                          reinterpret_cast<const std::uint8_t*>(sealed.bytes.data()) + 32, sealed.bytes.size() - 32,
                          reinterpret_cast<const std::uint8_t*>(original_additional.data()), original_additional.size(),
                          reinterpret_cast<const std::uint8_t*>(sealed.bytes.data()) + 8, key->data()) == 0);
        const auto additional = std::string(other.begin(), other.end()).append(subject).append("\n");
        std::string again(sealed.bytes.size() - 32, '\0');
        crypto_aead_xchacha20poly1305_ietf_encrypt(reinterpret_cast<std::uint8_t*>(again.data()), nullptr,
                                                   opened.data(), opened.size(),
                                                   reinterpret_cast<const std::uint8_t*>(additional.data()),
                                                   additional.size(), nullptr, other.data() + 8, key->data());
        return carried{.subject = std::string{subject}, .bytes = std::string(other.begin(), other.end()) + again};
    };
    auto own = original; // as its own message
    own.member = 2;
    BOOST_TEST(refuses(car3, plain(own, "cles.c.push.x")));
    auto later = original; // so that it counts again
    later.counter = 500;
    BOOST_TEST(refuses(car3, plain(later, "cles.c.push.x")));
    BOOST_TEST(refuses(car3, plain(original, "cles.c.push.y")));
    BOOST_TEST(takes(car3, plain(original, "cles.c.push.x"))); // what car1 has sent
}

BOOST_AUTO_TEST_CASE(an_instance_of_another_member_is_refused) {
    meet(car1, car2);
    auto sealed = car1.send("reply");
    const auto own = sealed.instance;
    sealed.instance = car3.messages.instance();
    BOOST_TEST(refuses(car2, sealed));
    sealed.instance = own;
    BOOST_TEST(takes(car2, sealed));
    sealed = car1.send("its subjects state no instance");
    sealed.instance = 0;
    BOOST_TEST(takes(car2, sealed));
}

BOOST_AUTO_TEST_CASE(each_counter_counts_once) {
    meet(car1, car2);
    std::vector<carried> sealed;
    for (int i = 0; i < 500; ++i) {
        sealed.push_back(car1.send("update"));
    }
    std::mt19937_64 order{1};
    std::ranges::shuffle(sealed, order);
    BOOST_TEST(std::ranges::all_of(sealed, [&](const auto& each) { return takes(car2, each); }));
    BOOST_TEST(std::ranges::all_of(sealed, [&](const auto& each) { return refuses(car2, each); }));
}

BOOST_AUTO_TEST_CASE(counters_that_are_1024_or_more_late_are_refused) {
    meet(car1, car2);
    std::vector<carried> sealed;
    for (int i = 0; i < 1025; ++i) {
        sealed.push_back(car1.send("update"));
    }
    BOOST_TEST(takes(car2, sealed[1024]));
    BOOST_TEST(refuses(car2, sealed[0]));
    BOOST_TEST(takes(car2, sealed[1]));
}

BOOST_AUTO_TEST_CASE(a_forged_message_with_a_late_counter_does_not_move_the_window) {
    meet(car1, car2);
    const auto sealed = car1.send("update");
    auto forgery = sealed;
    forgery.bytes[28] = 1; // the counter is 2^24 higher
    BOOST_TEST(refuses(car2, forgery));
    BOOST_TEST(takes(car2, sealed));
}

BOOST_AUTO_TEST_CASE(what_is_not_sealed_is_refused) {
    for (const std::string& plain : std::initializer_list<std::string>{
             "", "PULL car2:speed", std::string(300, 'x'), std::string(300, '\x84'), std::string(300, '\x86')}) {
        BOOST_TEST(refuses(car2, {.subject = "cles.a.beat.1", .bytes = plain}));
        BOOST_TEST(!on_question(car2, {.subject = car2.questions, .questions = car1.questions, .bytes = plain}));
    }
    BOOST_TEST(car2.take_questions().empty());
}

BOOST_AUTO_TEST_CASE(another_fleet_is_refused) {
    auto other = fleet_authority::found(key_from(201));
    other.add({.name = "car1", .key = test_fleet::key_of(1).public_part()});
    bridge stranger{other.share(), 1, 101};
    BOOST_TEST(refuses(car2, stranger.send("hello")));
    stranger.adopt(fleet); // is refused
    BOOST_TEST(stranger.known.in_force().fleet() == other.newest().fleet());
}

// -- who is alive --------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_sender_proves_that_it_is_alive) {
    const auto first = car1.send("request", "cles.b.pull", "cles.a.reply.1");
    const auto result = open(car2, first);
    BOOST_TEST((result.what == verdict::unproven));
    BOOST_TEST(result.sender == "car1");
    BOOST_TEST(result.message == "request");
    const auto asked = car2.take_questions();
    BOOST_REQUIRE(asked.size() == 1U);
    BOOST_TEST(asked[0].subject == car1.questions);
    BOOST_TEST(car2.take_questions().empty());

    BOOST_TEST(on_question(car1, asked[0])); // it does not know car1
    const auto unproven = car1.send("still unproven");
    auto answers = car1.take_questions(); // its answer, and a question of its own
    BOOST_REQUIRE(answers.size() == 2U);
    BOOST_TEST(answers[0].subject == car2.questions);
    BOOST_TEST(!takes(car2, unproven));
    static_cast<void>(car2.take_questions());
    int known = 0;
    for (const auto& each : answers) {
        known += on_question(car2, each) ? 1 : 0;
    }
    BOOST_TEST(known == 2); // car1 has become known, and does not know car2
    for (const auto& each : answers) {
        BOOST_TEST((open(car2, each).what == verdict::refused)); // their counters have been received
    }
    BOOST_TEST(takes(car2, car1.send("proven")));
    for (const auto& each : car2.take_questions()) {
        BOOST_TEST(on_question(car1, each));
    }
    BOOST_TEST(takes(car1, car2.send("proven")));
}

BOOST_AUTO_TEST_CASE(old_messages_do_not_count_once_their_sender_is_known) {
    const auto before = car1.send("before");
    BOOST_TEST((open(car2, before).what == verdict::unproven));
    const auto meanwhile = car1.send("meanwhile");
    settle(car1, car2);
    BOOST_TEST(refuses(car2, before));
    BOOST_TEST(refuses(car2, meanwhile));
    BOOST_TEST(takes(car2, car1.send("after")));
    for (const auto& each : exchanged) { // neither do questions and answers
        BOOST_TEST(!on_question(car1, each));
        BOOST_TEST(!on_question(car2, each));
    }
    BOOST_TEST(car1.take_questions().empty());
    BOOST_TEST(car2.take_questions().empty());
}

BOOST_AUTO_TEST_CASE(a_wrong_challenge_proves_nothing) {
    BOOST_TEST((open(car2, car1.send("hello")).what == verdict::unproven));
    const auto asked = car2.take_questions();
    BOOST_REQUIRE(asked.size() == 1U);
    for (const auto* const wrong : {"live AAAAAAAAAAAAAAAAAAAAAA", "live ", "live", "", "ask ", "ask x", "LIVE"}) {
        BOOST_TEST(!on_question(car2, car1.send(wrong, car2.questions, car1.questions)));
    }
    // The challenge of car1, by another connection of the same member, and by another member.
    BOOST_TEST(on_question(car1, asked[0]));
    auto answers = car1.take_questions();
    const auto challenge = std::string{open(car2, answers[0]).message};
    BOOST_REQUIRE(challenge.starts_with("live "));
    bridge second{fleet, 1, 104};
    BOOST_TEST(!on_question(car2, second.send(challenge, car2.questions, second.questions)));
    BOOST_TEST(!on_question(car2, car3.send(challenge, car2.questions, car3.questions)));
    BOOST_TEST(!takes(car2, car1.send("hello")));
    BOOST_TEST(on_question(car2, answers[0]));
    BOOST_TEST(takes(car2, car1.send("hello")));
    BOOST_TEST(!takes(car2, second.send("hello")));
}

BOOST_AUTO_TEST_CASE(an_answer_counts_for_ten_seconds_and_once) {
    BOOST_TEST((open(car2, car1.send("hello")).what == verdict::unproven));
    auto asked = car2.take_questions();
    BOOST_REQUIRE(on_question(car1, asked.at(0)));
    const auto late = car1.take_questions().at(0);
    now += 10s + 1ms;
    BOOST_TEST(!on_question(car2, late));
    BOOST_TEST(!takes(car2, car1.send("hello")));
    asked = car2.take_questions(); // it has asked again
    BOOST_REQUIRE(asked.size() == 1U);
    BOOST_REQUIRE(on_question(car1, asked[0]));
    const auto in_time = car1.take_questions().at(0);
    now += 10s;
    BOOST_TEST(on_question(car2, in_time));
    BOOST_TEST(!on_question(car2, in_time));
    BOOST_TEST(takes(car2, car1.send("hello")));
}

BOOST_AUTO_TEST_CASE(an_answer_is_that_of_its_subject) {
    BOOST_TEST((open(car2, car1.send("hello")).what == verdict::unproven));
    BOOST_TEST((open(car3, car1.send("hello")).what == verdict::unproven));
    auto asked = car2.take_questions().at(0);
    asked.subject = car3.questions; // another one gets the question
    BOOST_TEST(!on_question(car3, asked));
    asked.subject = car1.questions;
    asked.questions = car3.questions; // another one would get the answer
    BOOST_TEST(!on_question(car1, asked));
    BOOST_TEST(car1.take_questions().empty());
}

BOOST_AUTO_TEST_CASE(nobody_is_asked_without_its_subject_for_questions) {
    auto sealed = car1.send("hello");
    sealed.questions.clear();
    BOOST_TEST((open(car2, sealed).what == verdict::refused));
    BOOST_TEST(car2.take_questions().empty());
    auto ask = car1.send("ask AAAAAAAAAAAAAAAAAAAAAA", car2.questions, "");
    ask.questions.clear();
    BOOST_TEST(!on_question(car2, ask));
    BOOST_TEST(car2.take_questions().empty());
}

BOOST_AUTO_TEST_CASE(no_replay_counts_after_a_restart_of_either_end) {
    std::vector<carried> recorded;
    std::vector<carried> questions;
    std::optional<bridge> sender;
    std::optional<bridge> receiver;
    std::size_t accepted = 0;
    for (std::uint64_t round = 0; round < 12; ++round) {
        if (round % 2 == 0) {
            sender.emplace(fleet, 1, 1000 + round);
        }
        if (round % 3 == 0) {
            receiver.emplace(fleet, 2, 2000 + round);
        }
        const auto replay = [&] {
            for (const auto& each : recorded) {
                accepted += takes(*receiver, each) ? 1 : 0;
            }
            for (const auto& each : questions) {
                accepted += on_question(*receiver, each) ? 1 : 0;
            }
        };
        replay();
        static_cast<void>(receiver->take_questions()); // nobody is there to answer
        now += 2s;
        static_cast<void>(open(*receiver, sender->send("hello")));
        exchanged.clear();
        settle(*sender, *receiver);
        replay();
        questions.insert(questions.end(), exchanged.begin(), exchanged.end());
        for (int i = 0; i < 100; ++i) {
            recorded.push_back(sender->send("update"));
            BOOST_REQUIRE(takes(*receiver, recorded.back()));
        }
    }
    BOOST_TEST(recorded.size() >= 1000U);
    BOOST_TEST(accepted == 0U);
}

// What the sender was told to have had no effect must have none when it arrives again.
BOOST_AUTO_TEST_CASE(what_was_found_unproven_does_not_count_later) {
    BOOST_TEST((open(car2, car1.send("hello")).what == verdict::unproven));
    for (const auto& each : car2.take_questions()) {
        BOOST_TEST(on_question(car1, each));
    }
    const auto proofs = car1.take_questions();
    const auto overtakes = car1.send("sealed after the proof, and arrives before it");
    const auto later = car1.send("later");
    BOOST_TEST((open(car2, overtakes).what == verdict::unproven));
    BOOST_TEST(std::ranges::any_of(proofs, [&](const carried& each) { return on_question(car2, each); }));
    BOOST_TEST(refuses(car2, overtakes));
    BOOST_TEST(takes(car2, later));
}

// Nobody may be told that it had no effect if that is not noted.
BOOST_AUTO_TEST_CASE(a_message_is_unproven_only_while_its_sender_is_asked) {
    auto sealed = car1.send("hello");
    sealed.questions.clear();
    BOOST_TEST((open(car2, sealed).what == verdict::refused));
    BOOST_TEST((open(car2, car1.send("hello")).what == verdict::unproven));
    now += 11s;
    sealed = car1.send("hello");
    sealed.questions.clear();
    BOOST_TEST((open(car2, sealed).what == verdict::refused));
}

BOOST_AUTO_TEST_CASE(a_lost_bridge_has_to_prove_again_that_it_is_alive) {
    meet(car1, car2);
    meet(car3, car2);
    const auto withheld = car1.send("withheld");
    car2.messages.forget(car1.messages.instance());
    BOOST_TEST((open(car2, withheld).what == verdict::unproven));
    settle(car1, car2);
    BOOST_TEST(refuses(car2, withheld));
    BOOST_TEST(takes(car2, car1.send("again")));
    BOOST_TEST(takes(car2, car3.send("of another one")));
    car2.messages.forget(0);
    car2.messages.forget(~std::uint64_t{0});
    BOOST_TEST(takes(car2, car1.send("it was not that one")));
}

// What a server withholds may be an answer, too.
BOOST_AUTO_TEST_CASE(an_answer_from_before_a_bridge_was_lost_proves_nothing) {
    std::vector<carried> answers;
    for (int i = 0; i < 2; ++i) {
        BOOST_TEST((open(car2, car1.send("hello")).what == verdict::unproven));
        for (const auto& each : car2.take_questions()) {
            static_cast<void>(on_question(car1, each));
        }
        answers.push_back(car1.take_questions().front());
        now += 2s;
    }
    const auto withheld = car1.send("withheld");
    BOOST_TEST(on_question(car2, answers[1]));
    car2.messages.forget(car1.messages.instance());
    BOOST_TEST(!on_question(car2, answers[0]));
    BOOST_TEST(!takes(car2, withheld));
}

BOOST_AUTO_TEST_CASE(updates_and_other_messages_overtake_each_other) {
    meet(car1, car2);
    std::vector<carried> updates;
    for (int i = 0; i < 5'000; ++i) {
        updates.push_back(car1.send("update", "cles.a.feed.car1.speed"));
        updates.back().is_update = true;
    }
    BOOST_TEST(takes(car2, car1.send("a request that overtakes them")));
    BOOST_TEST(std::ranges::all_of(updates, [&](const carried& each) { return takes(car2, each); }));
    BOOST_TEST(std::ranges::none_of(updates, [&](const carried& each) { return takes(car2, each); }));
}

BOOST_AUTO_TEST_CASE(a_salt_is_asked_about_once_a_second) {
    std::size_t asked = 0;
    for (int i = 0; i < 30; ++i) {
        static_cast<void>(open(car2, car1.send("hello")));
        asked += car2.take_questions().size();
        now += 100ms;
    }
    BOOST_TEST(asked == 3U);
    bridge second{fleet, 1, 104};
    static_cast<void>(open(car2, second.send("hello")));
    BOOST_TEST(car2.take_questions().size() == 1U);
}

BOOST_AUTO_TEST_CASE(salts_are_asked_about_250_times_in_a_second) {
    constexpr std::size_t per_second = 250;
    std::vector<time_point> asked;
    for (std::uint64_t i = 0; i < 1'500; ++i) {
        bridge other{fleet, 1, 1000 + i};
        static_cast<void>(open(car2, other.send("hello")));
        asked.resize(asked.size() + car2.take_questions().size(), now);
        now += 1ms;
    }
    BOOST_TEST(asked.size() > 340U);
    for (std::size_t i = per_second; i < asked.size(); ++i) {
        BOOST_TEST((asked[i] - asked[i - per_second] >= 1s));
    }
}

BOOST_AUTO_TEST_CASE(questions_that_nobody_fetches_are_limited) {
    meet(car1, car2);
    for (int i = 0; i < 300; ++i) {
        BOOST_TEST(on_question(car2, car1.send("ask AAAAAAAAAAAAAAAAAAAAAA", car2.questions, car1.questions)));
        now += 1ms;
    }
    BOOST_TEST(car2.take_questions().size() == cles::security::sealed_messages::max_questions);
}

BOOST_AUTO_TEST_CASE(the_eight_newest_salts_of_a_member_are_known) {
    std::vector<std::unique_ptr<bridge>> all;
    for (std::uint64_t i = 0; i < 9; ++i) {
        all.push_back(std::make_unique<bridge>(fleet, 1, 1000 + i));
        meet(*all.back(), car2);
        now += 1s;
    }
    BOOST_TEST((open(car2, all[0]->send("hello")).what == verdict::unproven));
    for (std::size_t i = 1; i < all.size(); ++i) {
        BOOST_TEST(takes(car2, all[i]->send("hello")));
    }
}

// -- this end ------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(the_last_counter_is_not_passed) {
    bridge last{fleet, 1, 104, std::numeric_limits<std::uint64_t>::max() - 1};
    BOOST_TEST(takes(last, last.send("the last one")));
    BOOST_TEST(last.send("one more").bytes.empty());
    BOOST_TEST(last.send("one more").bytes.empty());
}

BOOST_AUTO_TEST_CASE(a_child_process_seals_nothing) {
    meet(car1, car2);
    const auto asked = car2.send("ask AAAAAAAAAAAAAAAAAAAAAA", car1.questions, car2.questions);
    BOOST_TEST(in_child([&] {
        return car1.send("hello").bytes.empty() && car1.send("hello").bytes.empty() && on_question(car1, asked) &&
               car1.take_questions().empty();
    }));
    BOOST_TEST(takes(car2, car1.send("hello")));
}

BOOST_AUTO_TEST_CASE(who_is_not_in_the_roster_seals_and_opens_nothing) {
    meet(car1, car2);
    fleet.remove(1);
    const auto before = car2.send("hello");
    car1.adopt(fleet);
    BOOST_TEST(car1.messages.instance() == 0U);
    BOOST_TEST(car1.send("hello").bytes.empty());
    BOOST_TEST(refuses(car1, before));
    BOOST_TEST(car1.take_questions().empty());
}

// -- the roster ----------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(a_removed_member_is_refused) {
    meet(car1, car2);
    fleet.remove(1);
    car2.adopt(fleet);
    auto sealed = car1.send("hello");
    BOOST_TEST(refuses(car2, sealed));
    BOOST_TEST(!on_question(car2, car1.send("ask AAAAAAAAAAAAAAAAAAAAAA", car2.questions, car1.questions)));
    BOOST_TEST(car2.take_questions().empty());
}

BOOST_AUTO_TEST_CASE(the_salt_of_a_member_that_comes_back_is_forgotten) {
    meet(car1, car2);
    fleet.remove(1);
    car2.adopt(fleet);
    fleet.add(1); // as number 4
    car2.adopt(fleet);
    car1.adopt(fleet);
    BOOST_TEST((car1.messages.instance() >> 40U) == 4U);
    BOOST_TEST((open(car2, car1.send("hello")).what == verdict::unproven));
}

BOOST_AUTO_TEST_CASE(the_next_generation_is_accepted) {
    meet(car1, car2);
    fleet.authority.rotate();
    car1.adopt(fleet);
    BOOST_TEST(takes(car2, car1.send("with the next key")));
    BOOST_TEST(takes(car1, car2.send("with the previous key")));
    fleet.authority.rotate();
    car1.adopt(fleet);
    BOOST_TEST(refuses(car1, car2.send("with one that is too old")));
}

BOOST_AUTO_TEST_CASE(a_later_generation_brings_the_newer_roster) {
    meet(car1, car2);
    fleet.remove(3);
    car1.adopt(fleet);
    auto sealed = car1.send("with another key");
    sealed.questions.clear();
    BOOST_TEST(refuses(car2, sealed));
    BOOST_TEST((open(car2, car1.send("with another key")).what == verdict::refused));
    auto asked = car2.take_questions();
    BOOST_REQUIRE(asked.size() == 1U);
    BOOST_TEST(asked[0].subject == car1.questions);
    BOOST_TEST(to_hex(as_bytes(asked[0].bytes)) == "8600000200000002");
    BOOST_TEST(!on_question(car1, asked[0]));
    auto answered = car1.take_questions();
    BOOST_REQUIRE(answered.size() == 1U);
    BOOST_TEST(answered[0].subject == car2.questions);
    BOOST_TEST(answered[0].bytes.size() == 4 + 48 + fleet.authority.newest().line().size());
    BOOST_TEST(!on_question(car2, answered[0]));
    BOOST_TEST(car2.known.in_force().version() == 3U);
    BOOST_TEST(takes(car2, car1.send("with another key")));
}

BOOST_AUTO_TEST_CASE(a_stated_version_brings_the_newer_roster) {
    meet(car1, car2);
    fleet.add(4);
    car1.adopt(fleet);
    car2.messages.on_stated_roster({.instance = car1.messages.instance(), .questions = car1.questions}, 2, now);
    BOOST_TEST(car2.take_questions().empty());
    car2.messages.on_stated_roster({.instance = car1.messages.instance(), .questions = car1.questions}, 3, now);
    settle(car1, car2);
    BOOST_TEST(car2.known.in_force().version() == 3U);
    BOOST_TEST(car2.rosters.size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_new_member_brings_the_newer_roster) {
    fleet.add(4);
    bridge car4{fleet, 4, 104};
    const auto sealed = car4.send("hello");
    BOOST_TEST((open(car2, sealed).what == verdict::refused));
    settle(car2, car4);
    BOOST_TEST(car2.known.in_force().version() == 3U);
    meet(car2, car4);
}

BOOST_AUTO_TEST_CASE(a_number_that_is_not_given_any_more_brings_no_roster) {
    fleet.remove(3);
    car2.adopt(fleet);
    BOOST_TEST(refuses(car2, car3.send("hello")));
}

BOOST_AUTO_TEST_CASE(an_instance_is_asked_for_its_roster_once_a_second) {
    meet(car1, car2);
    std::vector<time_point> asked;
    for (std::uint64_t i = 0; i < 3000; i += 10) {
        car2.messages.on_stated_roster({.instance = 77, .questions = "same"}, 9, now);
        for (const auto& each : car2.take_questions()) {
            BOOST_TEST(is_ask(each));
            asked.push_back(now);
        }
        now += 10ms;
    }
    BOOST_TEST(asked.size() == 3U);
}

// Messages that anybody can write, of generations and members that nobody knows, do not use up the questions for those
// that were opened.
BOOST_AUTO_TEST_CASE(what_cannot_be_opened_causes_fifty_questions_for_rosters_in_a_second) {
    meet(car1, car2);
    fleet.add(4);
    car1.adopt(fleet);
    std::vector<time_point> asked;
    for (std::uint8_t i = 0; i < 250; ++i) {
        group_salt salt{};
        salt[0] = i;
        bytes head(group_head_bytes);
        write_group_head(1, 9, salt, 1, head.data());
        head[0] = 0x85;
        const carried forged{.subject = "cles.a.beat.1",
                             .instance = std::uint64_t{1} << 40U | std::uint64_t{i} << 32U,
                             .questions = "x",
                             .bytes = std::string(head.begin(), head.end()) + std::string(200, 'x')};
        BOOST_TEST((open(car2, forged).what == verdict::refused));
        asked.resize(asked.size() + car2.take_questions().size(), now);
        now += 4ms;
    }
    BOOST_TEST(asked.size() >= 40U);
    for (std::size_t i = 50; i < asked.size(); ++i) {
        BOOST_TEST((asked[i] - asked[i - 50] >= 1s));
    }
    car2.messages.on_stated_roster(car1.send("").from(), 3, now);
    settle(car1, car2);
    BOOST_TEST(car2.known.in_force().version() == 3U);
}

BOOST_AUTO_TEST_CASE(a_member_is_given_a_roster_once_a_second_and_all_ten_times) {
    for (int car = 4; car < 40; ++car) {
        fleet.add(car);
    }
    car1.adopt(fleet);
    const auto given_to = [&](std::uint64_t member) {
        auto ask = std::string{"\x86\0\0\0\0\0\0\1", 8};
        ask[3] = static_cast<char>(member);
        BOOST_TEST(!on_question(
            car1,
            {.subject = car1.questions, .instance = member << 40U | 1U, .questions = car2.questions, .bytes = ask}));
        return car1.take_questions().size();
    };
    std::size_t given = 0;
    for (int i = 0; i < 300; ++i) {
        given += given_to(2);
        now += 10ms;
    }
    BOOST_TEST(given == 3U);
    now += 10s;
    given = 0;
    for (std::uint64_t member = 2; member < 40; ++member) {
        given += given_to(member);
        now += 1ms;
    }
    BOOST_TEST(given <= 10U);
    BOOST_TEST(given >= 1U);
}

BOOST_AUTO_TEST_CASE(a_roster_is_given_to_a_member_that_has_an_older_one) {
    fleet.add(4);
    car1.adopt(fleet);
    const auto gives = [&](std::string_view ask, std::optional<std::uint64_t> stated = {}) {
        now += 1s;
        const auto instance = stated.value_or(car2.messages.instance());
        BOOST_TEST(!on_question(
            car1,
            {.subject = car1.questions, .instance = instance, .questions = car2.questions, .bytes = std::string{ask}}));
        const auto given = car1.take_questions();
        BOOST_TEST(std::ranges::all_of(given, is_roster));
        return given.size() == 1;
    };
    using namespace std::string_view_literals;
    BOOST_TEST(gives("\x86\0\0\2\0\0\0\1"sv));
    BOOST_TEST(!gives("\x86\0\0\2\0\0\0\1"sv, 0));                        // states none
    BOOST_TEST(!gives("\x86\0\0\2\0\0\0\1"sv, car3.messages.instance())); // an instance of another member
    BOOST_TEST(!gives("\x86\0\0\2\0\0\0\3"sv));                           // it has this one
    BOOST_TEST(!gives("\x86\0\0\2\xff\xff\xff\xff"sv));
    BOOST_TEST(!gives("\x86\0\0\7\0\0\0\1"sv)); // not a member
    BOOST_TEST(!gives("\x86\0\0\0\0\0\0\1"sv));
    BOOST_TEST(!gives("\x86\0\0\2\0\0\0"sv));
    BOOST_TEST(!gives("\x86\0\0\2\0\0\0\1\0"sv));
    BOOST_TEST(!gives("\x86"sv));
    fleet.remove(2);
    car1.adopt(fleet);
    BOOST_TEST(!gives("\x86\0\0\2\0\0\0\1"sv)); // a member that was removed
}

BOOST_AUTO_TEST_CASE(who_gets_no_roster_does_not_keep_others_from_it) {
    fleet.add(4);
    car1.adopt(fleet);
    const auto ask = [&](std::uint32_t member, std::uint32_t version) {
        auto message = std::string{"\x86\0\0\0\0\0\0\0", 8};
        message[3] = static_cast<char>(member);
        message[7] = static_cast<char>(version);
        BOOST_TEST(!on_question(car1, {.subject = car1.questions,
                                       .instance = car2.messages.instance(),
                                       .questions = car2.questions,
                                       .bytes = message}));
    };
    ask(9, 1); // not a member
    ask(2, 3); // has it
    ask(2, 1);
    BOOST_TEST(car1.take_questions().size() == 1U);
}

BOOST_AUTO_TEST_CASE(a_roster_that_nobody_asked_for_is_dropped) {
    fleet.add(4);
    car1.adopt(fleet);
    const auto given = [&] {
        now += 1s;
        static_cast<void>(on_question(car1, {.subject = car1.questions,
                                             .instance = car2.messages.instance(),
                                             .questions = car2.questions,
                                             .bytes = std::string{"\x86\0\0\2\0\0\0\1", 8}}));
        return car1.take_questions().at(0);
    };
    const auto ask = [&] {
        car2.messages.on_stated_roster({.instance = car1.messages.instance(), .questions = car1.questions}, 3, now);
        BOOST_TEST(car2.take_questions().size() == 1U);
    };
    BOOST_TEST(!on_question(car2, given()));
    BOOST_TEST(car2.rosters.empty());
    ask();
    auto of_another = given();
    of_another.instance = car3.messages.instance();
    BOOST_TEST(!on_question(car2, of_another));
    of_another.bytes[3] = 3;
    BOOST_TEST(!on_question(car2, of_another)); // car3 was not asked
    BOOST_TEST(car2.rosters.empty());
    auto altered = given();
    altered.bytes[100] ^= 1;
    BOOST_TEST(!on_question(car2, altered)); // anybody can write it: the question stays open
    BOOST_TEST(car2.rosters.empty());
    auto late = given();
    now += 10s;
    BOOST_TEST(!on_question(car2, late));
    BOOST_TEST(car2.rosters.empty());
    ask();
    BOOST_TEST(!on_question(car2, given()));
    BOOST_TEST(car2.rosters.size() == 1U);
    BOOST_TEST(!on_question(car2, given())); // now it is answered
    BOOST_TEST(car2.rosters.size() == 1U);
    BOOST_TEST(car2.known.in_force().version() == 3U);
    const auto box_of = [](std::size_t size) { return std::string{"\x87\0\0\1", 4} + std::string(size, 'x'); };
    for (const std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{48}, std::size_t{1'000'049}}) {
        BOOST_TEST(!on_question(car2, {.subject = car2.questions,
                                       .instance = car1.messages.instance(),
                                       .questions = car1.questions,
                                       .bytes = box_of(size)}));
    }
    BOOST_TEST(car2.rosters.size() == 1U);
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace messages
