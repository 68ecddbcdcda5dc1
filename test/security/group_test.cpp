// SPDX-License-Identifier: BSL-1.0
#include "security/child_process.hpp"
#include "security/datagrams/group_receiver.hpp"
#include "security/datagrams/group_sender.hpp"
#include "security/sealed_network.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace group {
namespace {

using namespace std::chrono_literals;
using namespace cles::security;
using namespace cles::security::test;
using cles::time_point;
using ordered_by = group_receiver::ordered_by;
using verdict = group_receiver::verdict;

datagram_path at(int host, std::uint16_t port = 4000) {
    return datagram_path::v4(0x0a000000U + static_cast<std::uint32_t>(host), port);
}

bytes copy(bytes_view from) { return {from.begin(), from.end()}; }

// A member's end in the group.
struct member_end {
    seeded_entropy random;
    fleet known;
    group_sender sender;
    group_receiver receiver;
    std::uint32_t number;
    std::uint32_t epoch;

    member_end(const test_fleet& of, int car, std::uint64_t seed, std::uint64_t first_counter = 0)
        : random(seed), known(test_fleet::name_of(car), test_fleet::key_of(car), of.authority.share()),
          sender(known, random, first_counter), receiver(known, sender, random),
          number(static_cast<std::uint32_t>(car)), epoch(static_cast<std::uint32_t>(seed)) {}

    node_statement statement() {
        return {.roster = known.in_force().version(),
                .epoch = epoch,
                .salt = sender.salt(),
                .counter = sender.next_counter()};
    }
    void meet(member_end& other) { receiver.learn(other.number, other.statement()); }
    void adopt(const test_fleet& of) { static_cast<void>(known.offer(of.authority.newest().line())); }
    bytes seal(std::string_view line) { return copy(sender.seal(line)); }
};

struct three_cars {
    test_fleet fleet{3};
    member_end car1{fleet, 1, 101};
    member_end car2{fleet, 2, 102};
    member_end car3{fleet, 3, 103};
    time_point now{1h};

    group_receiver::result open(member_end& by, const bytes& datagram, datagram_path from = at(1)) {
        return by.receiver.open(from, datagram, now);
    }
    // Whether a line is opened and accepted.
    bool takes(member_end& by, const bytes& datagram, ordered_by order = ordered_by::counter) {
        const auto result = open(by, datagram);
        return result.what == verdict::opened && by.receiver.accept(result.accepted_by, order);
    }
    bool is_dropped(member_end& by, const bytes& datagram) {
        const auto result = open(by, datagram);
        return result.what == verdict::dropped && result.line.empty() && !result.contact;
    }
};

} // namespace

BOOST_FIXTURE_TEST_SUITE(group, three_cars)

BOOST_AUTO_TEST_CASE(the_vector_is_opened) {
    seeded_entropy random{1};
    cles::security::fleet car1{"car1", vector_key("car1"), reread(text_at(vectors(), "roster"))};
    group_sender sender{car1, random};
    group_receiver receiver{car1, sender, random};
    const auto datagram = from_hex(vector_text("group", "datagram"));
    BOOST_TEST((receiver.open(at(2), datagram, now).what == verdict::unknown_salt));
    node_statement stated{.epoch = 0x5f3a09c1, .counter = 17};
    std::ranges::copy(from_hex(vector_text("group", "salt")), stated.salt.begin());
    receiver.learn(3, stated);
    const auto result = receiver.open(at(2), datagram, now);
    BOOST_REQUIRE((result.what == verdict::opened));
    BOOST_TEST(result.line == vector_text("group", "line"));
    BOOST_TEST(result.epoch == 0x5f3a09c1U);
    BOOST_TEST(result.accepted_by.counter == 17U);
    BOOST_TEST(receiver.accept(result.accepted_by, ordered_by::counter));
}

BOOST_AUTO_TEST_CASE(the_vector_is_made) {
    cles::security::test::fixed_salt random{from_hex(vector_text("group", "salt"))};
    cles::security::fleet car2{"car2", vector_key("car2"), reread(text_at(vectors(), "roster"))};
    group_sender sender{car2, random, vectors().at("group").at("counter").to_number<std::uint64_t>()};
    BOOST_TEST(to_hex(sender.seal(vector_text("group", "line"))) == vector_text("group", "datagram"));
}

BOOST_AUTO_TEST_CASE(a_line_is_opened_by_who_has_a_session_with_the_sender) {
    car2.meet(car1);
    const auto datagram = car1.seal("UPDATE car1:speed seq=1 {}");
    const auto result = open(car2, datagram);
    BOOST_REQUIRE((result.what == verdict::opened));
    BOOST_TEST(result.line == "UPDATE car1:speed seq=1 {}");
    BOOST_TEST(result.accepted_by.member == 1U);
    BOOST_TEST(result.epoch == car1.epoch);
    BOOST_TEST(!result.contact);
    BOOST_TEST(car2.receiver.accept(result.accepted_by, ordered_by::counter));
}

BOOST_AUTO_TEST_CASE(an_announcement_counts_once_by_its_epoch_and_seq) {
    using repetition = cles::core::datagram_admission::repetition;
    const auto old = car1.seal("an announcement");
    car2.meet(car1);
    const auto take = [&](const bytes& datagram, std::uint64_t seq) {
        return car2.receiver.accept_announcement(open(car2, datagram).accepted_by, seq);
    };
    BOOST_TEST((take(old, 9) == repetition::refused)); // before the session
    const auto first = car1.seal("an announcement");
    BOOST_TEST((take(first, 7) == repetition::first));
    BOOST_TEST((take(first, 7) == repetition::again));
    BOOST_TEST((take(first, 6) == repetition::again));
    // Any member can seal it anew, with a counter that has not been received.
    BOOST_TEST((take(car1.seal("an announcement"), 7) == repetition::again));
    BOOST_TEST((take(car1.seal("an announcement"), 8) == repetition::first));
    // A salt of the same epoch changes nothing, one of another does.
    for (const auto epoch : {car1.epoch, car1.epoch + 1}) {
        member_end other{fleet, 1, 104 + epoch};
        other.epoch = epoch;
        car2.meet(other);
        const auto sealed = other.seal("an announcement");
        BOOST_TEST((take(sealed, 8) == (epoch == car1.epoch ? repetition::again : repetition::first)));
    }
}

BOOST_AUTO_TEST_CASE(the_longest_line_fits_and_a_longer_one_is_refused) {
    car2.meet(car1);
    const std::string longest(1200, 'x');
    const auto datagram = car1.seal(longest);
    BOOST_TEST(datagram.size() == 1248U);
    BOOST_TEST(open(car2, datagram).line == longest);
    BOOST_TEST(car1.seal(longest + "x").empty());
    BOOST_TEST(car1.sender.next_counter() == 1U);
    BOOST_TEST(open(car2, car1.seal("")).line.empty());
}

// -- what is refused -----------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(no_bit_can_be_changed) {
    car2.meet(car1);
    std::vector<bytes> sealed;
    for (int i = 0; i < 100; ++i) {
        sealed.push_back(car1.seal("UPDATE car1:speed seq=" + std::to_string(i)));
    }
    std::size_t opened = 0;
    for (const auto& datagram : sealed) {
        for (std::size_t bit = 0; bit < datagram.size() * 8; ++bit) {
            auto forged = datagram;
            forged[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
            opened += open(car2, forged).what == verdict::dropped ? 0 : 1;
        }
        for (std::size_t length = 0; length < datagram.size(); ++length) {
            opened +=
                open(car2, bytes(datagram.begin(), datagram.begin() + static_cast<std::ptrdiff_t>(length))).what ==
                        verdict::dropped
                    ? 0
                    : 1;
        }
    }
    BOOST_TEST(opened == 0U);
    for (const auto& datagram : sealed) {
        BOOST_TEST(takes(car2, datagram)); // forged ones do not keep them out
    }
}

BOOST_AUTO_TEST_CASE(each_counter_is_accepted_once) {
    car2.meet(car1);
    std::vector<bytes> sealed;
    for (int i = 0; i < 500; ++i) {
        sealed.push_back(car1.seal("UPDATE car1:speed seq=" + std::to_string(i)));
    }
    std::mt19937_64 order{1};
    std::ranges::shuffle(sealed, order);
    BOOST_TEST(std::ranges::all_of(sealed, [&](const auto& datagram) { return takes(car2, datagram); }));
    std::size_t again = 0;
    for (int i = 0; i < 20; ++i) {
        again += static_cast<std::size_t>(
            std::ranges::count_if(sealed, [&](const auto& datagram) { return takes(car2, datagram); }));
    }
    BOOST_TEST(again == 0U);
}

BOOST_AUTO_TEST_CASE(no_replay_is_accepted_across_restarts_of_either_end) {
    std::vector<bytes> recorded;
    std::optional<member_end> sender;
    std::optional<member_end> receiver;
    std::size_t accepted = 0;
    std::size_t replayed = 0;
    for (std::uint64_t round = 0; round < 20; ++round) {
        if (round % 2 == 0) {
            sender.emplace(fleet, 1, 1000 + round);
        }
        if (round % 3 == 0) {
            receiver.emplace(fleet, 2, 2000 + round);
        }
        for (const auto& datagram : recorded) { // under salts that are not known, or known from before
            accepted += takes(*receiver, datagram) ? 1 : 0;
            ++replayed;
        }
        receiver->meet(*sender);
        for (const auto& datagram : recorded) {
            accepted += takes(*receiver, datagram) ? 1 : 0;
            ++replayed;
        }
        for (int i = 0; i < 30; ++i) {
            recorded.push_back(sender->seal("UPDATE car1:speed"));
            BOOST_REQUIRE(takes(*receiver, recorded.back()));
        }
    }
    BOOST_TEST(accepted == 0U);
    BOOST_TEST(replayed >= 10000U);
    BOOST_TEST_MESSAGE(replayed << " datagrams replayed");
}

BOOST_AUTO_TEST_CASE(counters_before_the_stated_one_are_refused) {
    const auto before = car1.seal("UPDATE car1:speed seq=1 {}");
    car2.meet(car1);
    const auto after = car1.seal("UPDATE car1:speed seq=2 {}");
    BOOST_TEST(!takes(car2, before));
    BOOST_TEST(!takes(car2, before, ordered_by::signed_seq));
    BOOST_TEST(takes(car2, after));
}

BOOST_AUTO_TEST_CASE(counters_that_are_1024_or_more_late_are_refused) {
    car2.meet(car1);
    std::vector<bytes> sealed;
    for (int i = 0; i < 1025; ++i) {
        sealed.push_back(car1.seal("UPDATE car1:speed"));
    }
    BOOST_TEST(takes(car2, sealed[1024]));
    BOOST_TEST(!takes(car2, sealed[0]));
    BOOST_TEST(takes(car2, sealed[1]));
}

BOOST_AUTO_TEST_CASE(a_counter_is_noted_only_when_the_line_is_accepted) {
    car2.meet(car1);
    const auto datagram = car1.seal("UPDATE car1:speed");
    BOOST_TEST((open(car2, datagram, at(9)).what == verdict::opened)); // the node finds another source wrong
    BOOST_TEST(takes(car2, datagram));
    BOOST_TEST(!takes(car2, datagram));
}

BOOST_AUTO_TEST_CASE(a_forged_counter_does_not_keep_a_signed_update_out) {
    car2.meet(car1);
    for (int i = 0; i < 3000; ++i) {
        static_cast<void>(car1.seal("x"));
    }
    // Another member seals it again with a later counter, which is noted.
    const auto early = car1.seal("UPDATE car1:control seq=1 sig=...");
    for (int i = 0; i < 2000; ++i) {
        static_cast<void>(car1.seal("x"));
    }
    BOOST_TEST(takes(car2, car1.seal("later")));
    BOOST_TEST(!takes(car2, early));
    BOOST_TEST(takes(car2, early, ordered_by::signed_seq));
    BOOST_TEST(takes(car2, early, ordered_by::signed_seq)); // `seq` orders these
}

BOOST_AUTO_TEST_CASE(a_signed_update_notes_no_counter) {
    car2.meet(car1);
    const auto first = car1.seal("first");
    for (int i = 0; i < 2000; ++i) {
        static_cast<void>(car1.seal("x"));
    }
    BOOST_TEST(takes(car2, car1.seal("UPDATE car1:control sig=..."), ordered_by::signed_seq));
    BOOST_TEST(takes(car2, first));
}

BOOST_AUTO_TEST_CASE(a_ticket_of_a_salt_that_is_forgotten_is_refused) {
    car2.meet(car1);
    const auto result = open(car2, car1.seal("line"));
    BOOST_REQUIRE((result.what == verdict::opened));
    fleet.remove(1);
    car2.adopt(fleet);
    BOOST_TEST(!car2.receiver.accept(result.accepted_by, ordered_by::counter));
    BOOST_TEST(!car2.receiver.accept(result.accepted_by, ordered_by::signed_seq));
}

BOOST_AUTO_TEST_CASE(another_members_number_is_refused) {
    car3.meet(car1);
    car3.meet(car2);
    auto datagram = car1.seal("UPDATE car2:speed");
    datagram[3] = 2;
    BOOST_TEST(is_dropped(car3, datagram));
    datagram[3] = 9; // not a member
    BOOST_TEST(is_dropped(car3, datagram));
}

BOOST_AUTO_TEST_CASE(a_salt_of_one_member_does_not_count_for_another) {
    car3.meet(car1);
    car3.receiver.learn(2, car1.statement()); // car2 states car1's
    car3.receiver.learn(9, car1.statement()); // not a member
    BOOST_TEST(takes(car3, car1.seal("line")));
    member_end twin{fleet, 2, 101}; // draws the same salt as car1
    BOOST_REQUIRE(twin.sender.salt() == car1.sender.salt());
    const auto result = open(car3, twin.seal("line"));
    BOOST_TEST(result.accepted_by.member == 2U);
}

BOOST_AUTO_TEST_CASE(what_a_node_sends_itself_is_dropped) {
    BOOST_TEST(is_dropped(car1, car1.seal("line")));
    member_end second{fleet, 1, 104}; // another process with the same key
    BOOST_TEST((open(car1, second.seal("line")).what == verdict::unknown_salt));
}

BOOST_AUTO_TEST_CASE(unicast_datagrams_are_dropped) {
    BOOST_TEST(is_dropped(car1, bytes(100, 0x81)));
    BOOST_TEST(is_dropped(car1, bytes(100, 0x83)));
    BOOST_TEST(is_dropped(car1, {}));
}

// -- salts ---------------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(an_unknown_salt_is_dropped_and_its_source_contacted) {
    const auto datagram = car1.seal("UPDATE car1:cles {}");
    const auto result = open(car2, datagram, at(1));
    BOOST_TEST((result.what == verdict::unknown_salt));
    BOOST_TEST(result.line == "UPDATE car1:cles {}");
    BOOST_REQUIRE(result.contact);
    BOOST_TEST((*result.contact == datagram_source{.path = at(1), .member = 1}));
    BOOST_TEST(!car2.receiver.accept(result.accepted_by, ordered_by::signed_seq));
}

BOOST_AUTO_TEST_CASE(a_source_is_contacted_once_per_second) {
    int contacts = 0;
    for (int i = 0; i < 30; ++i) {
        contacts += open(car2, car1.seal("line"), at(1)).contact ? 1 : 0;
        now += 100ms;
    }
    BOOST_TEST(contacts == 3);
    BOOST_TEST(open(car2, car1.seal("line"), at(1)).contact.has_value());
    BOOST_TEST(!open(car2, car1.seal("line"), at(1)).contact);
    BOOST_TEST(open(car2, car1.seal("line"), at(1, 4001)).contact.has_value());
    BOOST_TEST(open(car2, car3.seal("line"), at(1)).contact.has_value());
}

BOOST_AUTO_TEST_CASE(fifty_sources_are_contacted_per_second) {
    std::vector<time_point> contacts;
    for (int i = 0; i < 4000; ++i) {
        const auto port = static_cast<std::uint16_t>(1000 + i);
        if (open(car2, car1.seal("line"), at(1, port)).contact) {
            contacts.push_back(now);
        }
        now += 1ms;
    }
    BOOST_TEST(contacts.size() > 80U);
    for (std::size_t i = 50; i < contacts.size(); ++i) {
        BOOST_TEST((contacts[i] - contacts[i - 50] >= 1s));
    }
}

BOOST_AUTO_TEST_CASE(repeated_datagrams_of_one_member_leave_contacts_for_others) {
    const auto recorded = car1.seal("line");
    int contacted = 0;
    for (int i = 0; i < 4000; ++i) {
        static_cast<void>(open(car2, recorded, at(1, static_cast<std::uint16_t>(1000 + i))));
        if (i % 1000 == 999) {
            contacted += open(car2, car3.seal("line"), at(3)).contact ? 1 : 0;
        }
        now += 1ms;
    }
    BOOST_TEST(contacted == 4);
}

BOOST_AUTO_TEST_CASE(what_cannot_be_opened_contacts_nobody) {
    auto forged = car1.seal("line");
    forged.back() ^= 1U;
    BOOST_TEST(is_dropped(car2, forged));
}

BOOST_AUTO_TEST_CASE(the_8_newest_salts_of_a_member_are_known) {
    std::vector<std::unique_ptr<member_end>> processes;
    for (std::uint64_t i = 0; i < 9; ++i) {
        processes.push_back(std::make_unique<member_end>(fleet, 1, 200 + i));
        car2.meet(*processes.back());
        if (i == 4) {
            car2.meet(*processes.front()); // stated again, so it is new
        }
    }
    for (std::size_t i = 0; i < processes.size(); ++i) {
        const auto result = open(car2, processes[i]->seal("line"));
        BOOST_TEST((result.what == verdict::opened) == (i != 1), "process " << i);
        BOOST_TEST(result.epoch == (i == 1 ? 0 : 200 + i));
    }
}

BOOST_AUTO_TEST_CASE(a_salt_that_is_stated_again_keeps_what_was_received) {
    car2.meet(car1);
    const auto first = car1.seal("first");
    const auto second = car1.seal("second");
    BOOST_TEST(takes(car2, first));
    car2.meet(car1); // states the counter 2
    BOOST_TEST(!takes(car2, first));
    BOOST_TEST(takes(car2, second)); // it was under way
}

BOOST_AUTO_TEST_CASE(at_the_end_of_the_counter_the_salt_is_new) {
    const auto last = std::numeric_limits<std::uint64_t>::max();
    member_end old{fleet, 1, 300, last - 2};
    car2.meet(old);
    const auto salt = old.sender.salt();
    BOOST_TEST(takes(car2, old.seal("one")));
    BOOST_TEST(old.sender.next_counter() == last - 1);
    BOOST_TEST(old.sender.salt() == salt);
    BOOST_TEST(takes(car2, old.seal("two")));
    BOOST_TEST(old.sender.next_counter() == 0U);
    BOOST_TEST(old.sender.salt() != salt);
    const auto result = open(car2, old.seal("three"));
    BOOST_TEST((result.what == verdict::unknown_salt));
    BOOST_TEST(result.contact.has_value());
    car2.meet(old);
    BOOST_TEST(takes(car2, old.seal("four")));
}

BOOST_AUTO_TEST_CASE(a_child_process_has_a_salt_of_its_own) {
    static_cast<void>(car1.seal("line"));
    const auto salt = car1.sender.salt();
    BOOST_TEST(in_child([&] { return car1.sender.salt() != salt && car1.sender.next_counter() == 0; }));
    BOOST_TEST(in_child([&] {
        const auto datagram = car1.seal("line");
        return !std::equal(salt.begin(), salt.end(), datagram.begin() + 8);
    }));
    BOOST_TEST(car1.sender.salt() == salt);
    BOOST_TEST(car1.sender.next_counter() == 1U);
}

BOOST_AUTO_TEST_CASE(no_nonce_is_used_twice) {
    std::set<std::string> nonces;
    member_end old{fleet, 1, 300, std::numeric_limits<std::uint64_t>::max() - 100};
    for (int i = 0; i < 300; ++i) {
        nonces.insert(to_hex(old.seal("line")).substr(16, 48));
    }
    BOOST_TEST(nonces.size() == 300U);
}

// -- generations ---------------------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(generations_around_a_rotation_are_accepted) {
    car1.meet(car2);
    car2.meet(car1);
    fleet.authority.rotate();
    car1.adopt(fleet);
    BOOST_TEST(takes(car2, car1.seal("with the next key")));
    BOOST_TEST(takes(car1, car2.seal("with the previous key")));
    fleet.authority.rotate();
    car1.adopt(fleet);
    const auto too_old = car2.seal("two generations behind");
    BOOST_TEST(is_dropped(car1, too_old));
}

BOOST_AUTO_TEST_CASE(a_later_generation_contacts_a_source) {
    car2.meet(car1);
    fleet.authority.rotate();
    fleet.authority.rotate();
    car1.adopt(fleet);
    const auto result = open(car2, car1.seal("line"), at(1));
    BOOST_TEST((result.what == verdict::dropped));
    BOOST_REQUIRE(result.contact);
    BOOST_TEST((*result.contact == datagram_source{.path = at(1), .member = 1}));
    fleet.add(4);
    member_end car4{fleet, 4, 104};
    now += 1s;
    BOOST_TEST(!open(car2, car4.seal("line"), at(4)).contact); // not known here yet
    car2.adopt(fleet);
    BOOST_TEST(takes(car2, car1.seal("line")));
}

BOOST_AUTO_TEST_CASE(for_later_generations_ten_are_contacted_per_second_at_random) {
    fleet.authority.rotate();
    fleet.authority.rotate();
    car1.adopt(fleet);
    std::vector<time_point> contacts;
    std::set<std::uint16_t> ports;
    for (int i = 0; i < 5000; ++i) {
        const auto port = static_cast<std::uint16_t>(1000 + i % 64);
        if (const auto contact = open(car2, car1.seal("line"), at(1, port)).contact) {
            contacts.push_back(now);
            ports.insert(contact->path.port);
        }
        now += 1ms;
    }
    BOOST_TEST(contacts.size() > 40U);
    for (std::size_t i = 10; i < contacts.size(); ++i) {
        BOOST_TEST((contacts[i] - contacts[i - 10] >= 1s));
    }
    BOOST_TEST(ports.size() > 16U);
}

BOOST_AUTO_TEST_CASE(one_source_does_not_decide_which_is_contacted) {
    fleet.authority.rotate();
    fleet.authority.rotate();
    car1.adopt(fleet);
    const auto datagram = car1.seal("line");
    int honest = 0;
    for (std::uint16_t i = 0; i < 100; ++i) {
        static_cast<void>(open(car2, datagram, at(2)));
        now += 120ms;
        const auto contact = open(car2, datagram, at(9, i)).contact; // always at the right time
        BOOST_REQUIRE(contact);
        honest += contact->path == at(2) ? 1 : 0;
    }
    BOOST_TEST(honest > 2);
}

BOOST_AUTO_TEST_CASE(sources_from_before_a_new_roster_are_not_contacted_for_later_generations) {
    const auto two_ahead = [&](member_end& car) {
        fleet.authority.rotate();
        fleet.authority.rotate();
        car.adopt(fleet);
        return car.seal("line");
    };
    const auto before = two_ahead(car1);
    BOOST_TEST(open(car2, before, at(2)).contact.has_value());
    BOOST_TEST(!open(car2, before, at(3)).contact); // later
    car2.adopt(fleet);
    const auto datagram = two_ahead(car1);
    for (int i = 0; i < 20; ++i) {
        now += 1s;
        const auto contact = open(car2, datagram, at(9)).contact;
        BOOST_REQUIRE(contact);
        BOOST_TEST((contact->path == at(9)));
    }
}

BOOST_AUTO_TEST_CASE(an_earlier_generation_than_the_oldest_shows_who_has_an_old_roster) {
    car1.meet(car2);
    const auto before = car2.seal("line");
    fleet.authority.rotate();
    car1.adopt(fleet);
    BOOST_TEST(!open(car1, before, at(2)).outdated); // it can still be opened
    fleet.authority.rotate();
    car1.adopt(fleet);
    const auto result = open(car1, before, at(2));
    BOOST_TEST((result.what == verdict::dropped));
    BOOST_TEST(!result.contact);
    BOOST_REQUIRE(result.outdated);
    BOOST_TEST((*result.outdated == datagram_source{.path = at(2), .member = 2}));
    // Each source once per second.
    now += 800ms;
    BOOST_TEST(!open(car1, before, at(2)).outdated);
    now += 200ms;
    BOOST_TEST(open(car1, before, at(2)).outdated.has_value());
    // Who is no member is told nothing.
    fleet.remove(3);
    car1.adopt(fleet);
    now += 1s;
    BOOST_TEST(!open(car1, car3.seal("line"), at(3)).outdated);
    // Nor is anybody by a node that has been removed.
    fleet.remove(1);
    car1.adopt(fleet);
    BOOST_TEST(!open(car1, before, at(2)).outdated);
}

BOOST_AUTO_TEST_CASE(of_earlier_generations_ten_sources_are_told_per_second_at_random) {
    const auto before = car2.seal("line");
    fleet.remove(3);
    car1.adopt(fleet);
    std::vector<time_point> told;
    for (int i = 0; i < 5000; ++i) {
        if (open(car1, before, at(9, static_cast<std::uint16_t>(1000 + i % 64))).outdated) {
            told.push_back(now);
        }
        now += 1ms;
    }
    for (std::size_t i = 10; i < told.size(); ++i) {
        BOOST_TEST((told[i] - told[i - 10] >= 1s));
    }
    BOOST_TEST(told.size() > 20U);
}

BOOST_AUTO_TEST_CASE(an_address_is_told_once_per_second_whatever_members_it_states) {
    const std::vector before{car2.seal("line"), car3.seal("line")};
    fleet.authority.rotate();
    fleet.authority.rotate();
    car1.adopt(fleet);
    int told = 0;
    for (int i = 0; i < 300; ++i) {           // of 10 ms
        for (const auto& datagram : before) { // anybody can repeat these, from the address of another
            told += open(car1, datagram, at(9)).outdated ? 1 : 0;
        }
        now += 10ms;
    }
    BOOST_TEST(told == 3);
}

BOOST_AUTO_TEST_CASE(a_source_that_was_chosen_is_not_chosen_again_until_it_sends) {
    const auto before = car2.seal("line");
    fleet.authority.rotate();
    fleet.authority.rotate();
    car1.adopt(fleet);
    for (int host = 2; host < 40; ++host) {
        const auto told = open(car1, before, at(host)).outdated;
        BOOST_REQUIRE(told);
        BOOST_TEST((told->path == at(host)));
        now += 1s;
    }
}

BOOST_AUTO_TEST_CASE(earlier_and_later_generations_share_one_limit) {
    const auto two_ahead = [&](member_end& car) {
        fleet.authority.rotate();
        fleet.authority.rotate();
        car.adopt(fleet);
    };
    const auto earlier = car3.seal("line");
    two_ahead(car1);
    two_ahead(car2);
    const auto later = car2.seal("line");
    std::vector<time_point> chosen;
    for (std::uint16_t i = 0; i < 3000; ++i) {
        if (open(car1, earlier, at(3, i)).outdated) {
            chosen.push_back(now);
        }
        if (open(car1, later, at(2, i)).contact) {
            chosen.push_back(now);
        }
        now += 1ms;
    }
    BOOST_TEST(chosen.size() > 20U);
    for (std::size_t i = 10; i < chosen.size(); ++i) {
        BOOST_TEST((chosen[i] - chosen[i - 10] >= 1s));
    }
}

BOOST_AUTO_TEST_CASE(a_removed_member_is_not_received_and_receives_nothing) {
    car1.meet(car2);
    car2.meet(car1);
    fleet.remove(2);
    car1.adopt(fleet);
    BOOST_TEST(is_dropped(car1, car2.seal("line")));
    BOOST_TEST((open(car2, car1.seal("line")).what == verdict::dropped)); // it does not have the key
    car2.adopt(fleet);
    BOOST_TEST(car2.seal("line").empty());
    BOOST_TEST(is_dropped(car2, car1.seal("line")));
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace group
