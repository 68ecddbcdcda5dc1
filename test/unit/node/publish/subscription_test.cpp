// SPDX-License-Identifier: BSL-1.0
#include "node/publish/subscription.hpp"

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
    [[nodiscard]] bool is_bound() const noexcept override { return bound; }

    std::vector<std::string> events;
    std::vector<cles::core::feed_mailbox::hand_over> when; // how each was delivered
    bool bound = true;

  private:
    bool on_event(const cles::detail::raw_event& event, cles::core::feed_mailbox::hand_over how) override {
        if (!event.has_json()) {
            return false;
        }
        when.push_back(how);
        if (event.kind == feed_event::gap) {
            events.push_back("gap of " + std::to_string(event.missed));
        } else {
            events.push_back(std::string{event.publisher} + " " + std::to_string(event.seq) + " " +
                             std::string{event.body});
        }
        return true;
    }
};

/// Delivers an update. Returns false if it is new to no subscription.
bool hear(cles::core::subscriptions& all, std::uint64_t seq) {
    const auto line = "UPDATE car1:speed seq=" + std::to_string(seq) + " epoch=0000000a {}";
    cles::protocol::request_line update;
    cles::protocol::malformed_request error;
    BOOST_REQUIRE(cles::protocol::parse_request(line, update, error));
    const auto found = all.find(line, update);
    return found.whose != nullptr && all.deliver(found);
}

bool take(recorder& s, std::string_view line) {
    cles::protocol::request_line update;
    cles::protocol::malformed_request error;
    BOOST_REQUIRE(cles::protocol::parse_request(line, update, error));
    return s.take(update);
}

} // namespace
} // namespace subscription

BOOST_AUTO_TEST_SUITE(subscription)

BOOST_AUTO_TEST_CASE(an_update_is_delivered_with_publisher_seq_and_body) {
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

BOOST_AUTO_TEST_CASE(updates_left_out_by_every_are_not_a_gap) {
    recorder s{"car1", "speed", true, 16};
    take(s, "UPDATE car1:speed seq=1 epoch=0000000a");
    take(s, "UPDATE car1:speed seq=4 epoch=0000000a");
    const std::vector<std::string> expected{"car1 1 {}", "car1 4 {}"};
    BOOST_TEST(s.events == expected, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(an_old_or_repeated_update_is_not_delivered) {
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

BOOST_AUTO_TEST_CASE(a_removed_subscription_is_not_found) {
    cles::core::subscriptions all;
    recorder one{"car1", "speed", false, 16};
    recorder two{"car2", "speed", false, 16};
    all.add(one);
    all.add(two);
    all.remove(one);
    BOOST_TEST(all.find("car1", "speed") == nullptr);
    BOOST_TEST(all.find("car2", "speed") == &two);
    all.remove(one); // a second time has no effect
    all.remove(two);
    BOOST_TEST(all.empty());
}

BOOST_AUTO_TEST_CASE(self_is_the_node_at_the_other_end) {
    cles::core::subscriptions all;
    recorder by_self{"self", "speed", false, 16};
    all.add(by_self);
    BOOST_TEST(all.find("car1", "speed") == &by_self);
    BOOST_TEST(all.find("car2", "speed") == &by_self);
}

BOOST_AUTO_TEST_CASE(subscriptions_with_the_same_noun_and_terms_share_a_binding) {
    cles::core::subscriptions all;
    recorder one{"car1", "speed", false, 16};
    recorder two{"car1", "speed", false, 16};
    recorder thinned{"car1", "speed", true, 16};
    recorder none{"car1", "speed", false, 16};
    one.set_sharing_key("every=0");
    two.set_sharing_key("every=0");
    thinned.set_sharing_key("every=100");
    BOOST_TEST(all.add(one));
    BOOST_TEST(all.admits(two));
    BOOST_TEST(!all.admits(thinned));
    BOOST_TEST(!all.admits(none));
    BOOST_TEST(all.add(two));
    BOOST_TEST(!all.add(none));
    BOOST_TEST(hear(all, 1));
    BOOST_TEST(one.events.size() == 1U);
    BOOST_TEST(two.events.size() == 1U);
    BOOST_TEST(!hear(all, 1));
    all.remove(one);
    BOOST_TEST(hear(all, 2));
    BOOST_TEST(one.events.size() == 1U);
    BOOST_TEST(two.events.size() == 2U);
    BOOST_TEST(all.has("car1", "speed"));
    all.remove(two);
    BOOST_TEST(all.empty());
    BOOST_TEST(all.add(thinned));
    all.remove(thinned);
}

// User code runs only in the last call, when the list is no longer used.
BOOST_AUTO_TEST_CASE(of_those_that_share_only_the_last_receives_an_update_at_once) {
    using cles::core::feed_mailbox;
    cles::core::subscriptions all;
    recorder one{"car1", "speed", false, 16};
    recorder two{"car1", "speed", false, 16};
    for (auto* each : {&one, &two}) {
        each->set_sharing_key("every=0");
        all.add(*each);
    }
    BOOST_TEST(hear(all, 1));
    BOOST_TEST((one.when == std::vector{feed_mailbox::hand_over::later}));
    BOOST_TEST((two.when == std::vector{feed_mailbox::hand_over::now}));
    all.remove(two);
    BOOST_TEST(hear(all, 2));
    BOOST_TEST((one.when.back() == feed_mailbox::hand_over::now));
}

BOOST_AUTO_TEST_CASE(an_update_before_its_own_reply_is_for_the_others_only) {
    cles::core::subscriptions all;
    recorder one{"car1", "speed", false, 16};
    recorder two{"car1", "speed", false, 16};
    for (auto* each : {&one, &two}) {
        each->set_sharing_key("every=0");
        each->bound = false;
        all.add(*each);
    }
    BOOST_TEST(!all.has_bound_for(two));
    BOOST_TEST(!hear(all, 1));
    two.bound = true; // the replies may arrive in any order
    BOOST_TEST(!all.has_bound_for(two));
    BOOST_TEST(all.has_bound_for(one));
    BOOST_TEST(hear(all, 2));
    BOOST_TEST(one.events.empty());
    BOOST_TEST(two.events.size() == 1U);
    two.bound = false;
    BOOST_TEST(!hear(all, 3));
}

// A subscription that is removed leaves the binding to the others, each of which may be the last.
BOOST_AUTO_TEST_CASE(has_shared_is_kept_until_it_is_added_again) {
    cles::core::subscriptions all;
    recorder one{"car1", "speed", false, 16};
    recorder two{"car1", "speed", false, 16};
    one.set_sharing_key("every=0");
    two.set_sharing_key("every=0");
    all.add(one);
    BOOST_TEST(!one.has_shared());
    all.add(two);
    all.remove(one);
    BOOST_TEST(one.has_shared());
    BOOST_TEST(two.has_shared());
    all.remove(two);
    BOOST_TEST(two.has_shared());
    all.add(one);
    BOOST_TEST(!one.has_shared());
    all.remove(one);
}

BOOST_AUTO_TEST_CASE(updates_up_to_a_mark_are_old_and_missing_ones_after_it_are_a_gap) {
    recorder s{"car1", "speed", false, 16};
    s.skip_to({.seq = 10, .epoch = 0xa});
    BOOST_TEST(!take(s, "UPDATE car1:speed seq=9 epoch=0000000a"));
    BOOST_TEST(!take(s, "UPDATE car1:speed seq=10 epoch=0000000a"));
    BOOST_TEST(take(s, "UPDATE car1:speed seq=13 epoch=0000000a"));
    const std::vector<std::string> expected{"gap of 2", "car1 13 {}"};
    BOOST_TEST(s.events == expected, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_SUITE_END()
