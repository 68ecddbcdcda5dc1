// SPDX-License-Identifier: BSL-1.0
#include "node/publish/group_feeds.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace group_feed {
namespace {

cles::limits few_publishers() {
    cles::limits bounds;
    bounds.publishers = 2;
    return bounds;
}

/// One wait for an event; it lives on the stack of its test.
struct wait final : cles::detail::pending_event {
    bool deliver(const cles::detail::raw_event& event) override {
        text = event.kind == cles::feed_event::gap ? "gap of " + std::to_string(event.missed)
                                                   : std::to_string(event.seq) + " " + std::string{event.body};
        text = std::string{event.publisher} + " " + text;
        return true;
    }
    void fail(boost::system::error_code, std::string_view) override {}
    void discard() noexcept override {}
    std::string text;
};

using lines = std::vector<std::string>;

struct fixture {
    explicit fixture(const cles::limits& bounds = {}) : feed(bounds, completions, "all", "speed") {}

    bool hear(const std::string& line) {
        cles::protocol::request_line r;
        cles::protocol::malformed_request why;
        BOOST_REQUIRE(cles::protocol::parse_request(line, r, why));
        return feed.take(r);
    }
    bool hear(const std::string& publisher, std::uint64_t seq, const std::string& epoch = "00000001") {
        return hear("UPDATE " + publisher + ":speed seq=" + std::to_string(seq) + " epoch=" + epoch + " {}");
    }
    /// As "car1 1 {}", "car1 gap of 2".
    lines events() {
        lines all;
        for (;;) {
            wait w;
            if (!feed.mail().next(cles::core::feed_mailbox::event_ptr{&w})) {
                feed.mail().cancel();
                return all;
            }
            feed.mail().pump();
            all.push_back(w.text);
        }
    }

    cles::core::completion_queue completions;
    cles::core::group_feed feed;
};

struct small : fixture {
    small() : fixture(few_publishers()) {}
};

} // namespace
} // namespace group_feed

BOOST_FIXTURE_TEST_SUITE(group_feed, fixture)

BOOST_AUTO_TEST_CASE(all_wants_every_publisher_and_a_name_only_one) {
    BOOST_TEST(feed.wants("car1"));
    const cles::core::group_feed one{{}, completions, "car1", "speed"};
    BOOST_TEST(one.wants("car1"));
    BOOST_TEST(!one.wants("car2"));
}

BOOST_AUTO_TEST_CASE(sequences_are_tracked_for_each_publisher_separately) {
    BOOST_TEST(hear("car1", 5));
    BOOST_TEST(hear("car2", 1));
    BOOST_TEST(hear("car1", 8));
    BOOST_TEST(!hear("car1", 8));
    BOOST_TEST(!hear("car1", 6));
    BOOST_TEST(hear("car2", 2));
    BOOST_TEST((events() == lines{"car1 5 {}", "car2 1 {}", "car1 gap of 2", "car1 8 {}", "car2 2 {}"}));
    BOOST_TEST(hear("car1", 1, "00000002")); // restarted
    BOOST_TEST(!hear("car1", 9, "00000001"));
    BOOST_TEST((events() == lines{"car1 1 {}"}));
}

BOOST_AUTO_TEST_CASE(a_body_that_is_not_json_appears_as_a_gap) {
    hear("car1", 1);
    BOOST_TEST(!hear("UPDATE car1:speed seq=2 epoch=00000001 {\"v\":}"));
    hear("car1", 3);
    BOOST_TEST((events() == lines{"car1 1 {}", "car1 gap of 1", "car1 3 {}"}));
}

BOOST_FIXTURE_TEST_CASE(the_publishers_that_are_told_apart_are_bounded, small) {
    hear("car1", 5);
    hear("car2", 5);
    hear("car1", 6);
    hear("car3", 5); // car2 has been silent for longest
    BOOST_TEST(feed.publishers() == 2U);
    BOOST_TEST(!hear("car1", 6));
    BOOST_TEST(hear("car2", 5));
    BOOST_TEST(feed.publishers() == 2U);
}

BOOST_AUTO_TEST_SUITE_END()
