// SPDX-License-Identifier: BSL-1.0
#include "core/subscription.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <string_view>
#include <vector>

namespace subscription {
namespace {

using cles::feed_event;

class recorder final : public cles::core::subscription {
  public:
    using subscription::subscription;

    std::vector<std::string> events;

  private:
    bool on_event(const cles::detail::raw_event& event) override {
        if (!event.has_json()) {
            return false;
        }
        if (event.kind == feed_event::gap) {
            events.push_back("gap of " + std::to_string(event.missed));
        } else {
            events.push_back(std::string{event.publisher} + " " + std::to_string(event.seq) + " " +
                             std::string{event.body});
        }
        return true;
    }
};

bool take(recorder& s, std::string_view line) {
    cles::protocol::request_line update;
    cles::protocol::malformed_request error;
    BOOST_REQUIRE(cles::protocol::parse_request(line, update, error));
    return s.take(update);
}

} // namespace
} // namespace subscription

BOOST_AUTO_TEST_SUITE(subscription)

BOOST_AUTO_TEST_CASE(an_update_is_handed_on_with_its_publisher_seq_and_body) {
    recorder s{"car1", "speed", false, 16};
    BOOST_TEST(take(s, "UPDATE car1:speed seq=17 epoch=0000000a {\"v\":3}"));
    BOOST_TEST(s.events == std::vector<std::string>{"car1 17 {\"v\":3}"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(a_missing_body_counts_as_an_empty_object) {
    recorder s{"car1", "speed", false, 16};
    BOOST_TEST(take(s, "UPDATE car1:speed seq=1 epoch=0000000a"));
    BOOST_TEST(s.events == std::vector<std::string>{"car1 1 {}"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(a_gap_comes_before_the_update_that_shows_it) {
    recorder s{"car1", "speed", false, 16};
    take(s, "UPDATE car1:speed seq=1 epoch=0000000a");
    take(s, "UPDATE car1:speed seq=4 epoch=0000000a");
    const std::vector<std::string> expected{"car1 1 {}", "gap of 2", "car1 4 {}"};
    BOOST_TEST(s.events == expected, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(what_every_thins_is_no_gap) {
    recorder s{"car1", "speed", true, 16};
    take(s, "UPDATE car1:speed seq=1 epoch=0000000a");
    take(s, "UPDATE car1:speed seq=4 epoch=0000000a");
    const std::vector<std::string> expected{"car1 1 {}", "car1 4 {}"};
    BOOST_TEST(s.events == expected, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(an_old_or_repeated_update_is_not_handed_on) {
    recorder s{"car1", "speed", false, 16};
    take(s, "UPDATE car1:speed seq=5 epoch=0000000a");
    BOOST_TEST(!take(s, "UPDATE car1:speed seq=5 epoch=0000000a"));
    BOOST_TEST(!take(s, "UPDATE car1:speed seq=4 epoch=0000000a"));
    BOOST_TEST(s.events.size() == 1U);
}

BOOST_AUTO_TEST_CASE(self_may_be_the_same_node_as_a_name) {
    cles::core::subscriptions all;
    recorder by_name{"car1", "speed", false, 16};
    recorder other{"car2", "speed", false, 16};
    recorder by_self{"self", "speed", false, 16};
    recorder elsewhere{"self", "load", false, 16};
    BOOST_TEST(all.add(by_name));
    BOOST_TEST(all.add(other));
    BOOST_TEST(!all.add(by_self));
    BOOST_TEST(all.add(elsewhere));
    BOOST_TEST(all.has("self", "speed"));
    BOOST_TEST(all.has("car3", "load"));
}

BOOST_AUTO_TEST_CASE(one_subscription_per_publisher_and_noun) {
    cles::core::subscriptions all;
    recorder first{"car1", "speed", false, 16};
    recorder second{"car1", "speed", false, 16};
    recorder other_node{"car2", "speed", false, 16};
    recorder other_noun{"car1", "speed/fast", false, 16};
    BOOST_TEST(all.empty());
    BOOST_TEST(all.add(first));
    BOOST_TEST(!all.add(second));
    BOOST_TEST(all.add(other_node));
    BOOST_TEST(all.add(other_noun));
    BOOST_TEST(all.find("car1", "speed") == &first);
    BOOST_TEST(all.find("car2", "speed") == &other_node);
    BOOST_TEST(all.find("car1", "speed/fast") == &other_noun);
    BOOST_TEST(all.find("car3", "speed") == nullptr);
    BOOST_TEST(all.find("car1", "speed/slow") == nullptr);
}

BOOST_AUTO_TEST_CASE(what_was_removed_is_found_no_more) {
    cles::core::subscriptions all;
    recorder one{"car1", "speed", false, 16};
    recorder two{"car2", "speed", false, 16};
    all.add(one);
    all.add(two);
    all.remove(one);
    BOOST_TEST(all.find("car1", "speed") == nullptr);
    BOOST_TEST(all.find("car2", "speed") == &two);
    all.remove(one); // once more does no harm
    all.remove(two);
    BOOST_TEST(all.empty());
}

BOOST_AUTO_TEST_CASE(self_is_whoever_is_at_the_other_end) {
    cles::core::subscriptions all;
    recorder by_self{"self", "speed", false, 16};
    all.add(by_self);
    BOOST_TEST(all.find("car1", "speed") == &by_self);
    BOOST_TEST(all.find("car2", "speed") == &by_self);
}

BOOST_AUTO_TEST_CASE(those_of_one_noun_and_the_same_terms_share_a_binding) {
    cles::core::subscriptions all;
    recorder one{"car1", "speed", false, 16};
    recorder two{"car1", "speed", false, 16};
    recorder thinned{"car1", "speed", true, 16};
    recorder none{"car1", "speed", false, 16};
    one.share_by("every=0");
    two.share_by("every=0");
    thinned.share_by("every=100");
    BOOST_TEST(all.add(one));
    BOOST_TEST(all.admits(two));
    BOOST_TEST(!all.admits(thinned));
    BOOST_TEST(!all.admits(none));
    BOOST_TEST(all.add(two));
    BOOST_TEST(!all.add(none));
    const auto hear = [&all](std::uint64_t seq) {
        const auto line = "UPDATE car1:speed seq=" + std::to_string(seq) + " epoch=0000000a {}";
        cles::protocol::request_line update;
        cles::protocol::malformed_request error;
        BOOST_REQUIRE(cles::protocol::parse_request(line, update, error));
        const auto found = all.find(line, update);
        return found.whose != nullptr && all.deliver(found);
    };
    BOOST_TEST(hear(1));
    BOOST_TEST(one.events.size() == 1U);
    BOOST_TEST(two.events.size() == 1U);
    BOOST_TEST(!hear(1));
    all.remove(one);
    BOOST_TEST(hear(2));
    BOOST_TEST(one.events.size() == 1U);
    BOOST_TEST(two.events.size() == 2U);
    BOOST_TEST(all.has("car1", "speed"));
    all.remove(two);
    BOOST_TEST(all.empty());
    BOOST_TEST(all.add(thinned));
    all.remove(thinned);
}

BOOST_AUTO_TEST_SUITE_END()
