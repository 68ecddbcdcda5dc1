// SPDX-License-Identifier: BSL-1.0
#include "gateway/told/update_events.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

namespace update_events {
namespace {

using cles::feed_event;
using item = cles::feed_item<cles::json_text>;

item value(feed_event kind, std::uint64_t seq, std::uint32_t epoch, std::string json) {
    item made;
    made.kind = kind;
    made.seq = seq;
    made.epoch = epoch;
    made.value.text = std::move(json);
    return made;
}

item gap(std::uint64_t missed) {
    item made;
    made.kind = feed_event::gap;
    made.missed = missed;
    return made;
}

/// The events of one client.
struct client {
    gateway::update_events events;

    explicit client(std::optional<cles::update_mark> last = {}, bool is_thinned = false, bool is_of_all = false)
        : events(is_of_all, is_thinned, last) {}
    std::string take(const item& what) {
        std::string out;
        events.take(what, out);
        return out;
    }
};

constexpr cles::update_mark seventeen{.seq = 17, .epoch = 0x5f3a09c1};

} // namespace
} // namespace update_events

BOOST_AUTO_TEST_SUITE(update_events)

BOOST_AUTO_TEST_CASE(an_event_has_lines) {
    std::string out;
    gateway::append_event(out, "gap", "7", "{}");
    gateway::append_event(out, "", "", "{\n\"a\":\r\n1}");
    BOOST_TEST(out == "id: 7\nevent: gap\ndata: {}\n\ndata: { \"a\":  1}\n\n");
}

BOOST_AUTO_TEST_CASE(an_update_has_an_id) {
    client c;
    BOOST_TEST(c.take(update_events::value(feed_event::current, 17, 0x5f3a09c1, "{\"a\":1}")) ==
               "id: 5f3a09c1.17\ndata: {\"a\":1}\n\n");
    BOOST_TEST(c.take(update_events::value(feed_event::update, 18, 0x5f3a09c1, "{\"a\":2}")) ==
               "id: 5f3a09c1.18\ndata: {\"a\":2}\n\n");
    BOOST_TEST(client{}.take(update_events::value(feed_event::update, 1, 0xc1, "3")) == "id: 000000c1.1\ndata: 3\n\n");
    BOOST_TEST(client{}.take(update_events::value(feed_event::current, 0, 0, "{}")) == "data: {}\n\n"); // not marked
}

BOOST_AUTO_TEST_CASE(an_id_is_read_again) {
    BOOST_TEST((gateway::mark_in(gateway::event_id_of(seventeen)) == seventeen));
    for (const auto* const text :
         {"", "17", ".17", "5f3a09c1.", "5f3a09c1", "5f3a09c.17", "5f3a09c11.17", "5f3a09cx.17", "5f3a09c1.-1",
          "5f3a09c1.1x", "5f3a09c1.18446744073709551616", "0x3a09c1.17"}) {
        BOOST_TEST(!gateway::mark_in(text).has_value(), text);
    }
}

BOOST_AUTO_TEST_CASE(a_client_that_comes_back_gets_no_value_twice) {
    client c{seventeen};
    BOOST_TEST(c.take(update_events::value(feed_event::current, 17, 0x5f3a09c1, "{}")) == "");
    BOOST_TEST(c.take(update_events::value(feed_event::update, 18, 0x5f3a09c1, "{}")) ==
               "id: 5f3a09c1.18\ndata: {}\n\n");
}

BOOST_AUTO_TEST_CASE(it_is_told_what_it_has_missed) {
    client c{seventeen};
    BOOST_TEST(c.take(update_events::value(feed_event::current, 20, 0x5f3a09c1, "{}")) ==
               "event: gap\ndata: {\"missed\":2}\n\nid: 5f3a09c1.20\ndata: {}\n\n");
    client without_value{seventeen}; // the first that it gets is an update
    BOOST_TEST(without_value.take(update_events::value(feed_event::update, 19, 0x5f3a09c1, "{}")) ==
               "event: gap\ndata: {\"missed\":1}\n\nid: 5f3a09c1.19\ndata: {}\n\n");
    client thinned{seventeen, true};
    BOOST_TEST(thinned.take(update_events::value(feed_event::current, 20, 0x5f3a09c1, "{}")) ==
               "id: 5f3a09c1.20\ndata: {}\n\n");
}

BOOST_AUTO_TEST_CASE(a_gap_is_told_once) {
    client c;
    static_cast<void>(c.take(update_events::value(feed_event::update, 1, 7, "{}")));
    BOOST_TEST(c.take(update_events::gap(3)) == "event: gap\ndata: {\"missed\":3}\n\n");
    BOOST_TEST(c.take(update_events::value(feed_event::update, 5, 7, "{}")) == "id: 00000007.5\ndata: {}\n\n");
}

BOOST_AUTO_TEST_CASE(another_run_of_the_publisher_is_told) {
    client c{seventeen};
    BOOST_TEST(c.take(update_events::value(feed_event::current, 3, 0xa, "{}")) ==
               "event: restart\ndata: {\"epoch\":\"0000000a\"}\n\nid: 0000000a.3\ndata: {}\n\n");
    BOOST_TEST(c.take(update_events::value(feed_event::update, 4, 0xa, "{}")) == "id: 0000000a.4\ndata: {}\n\n");
}

BOOST_AUTO_TEST_CASE(a_publisher_may_be_lost) {
    client c;
    static_cast<void>(c.take(update_events::value(feed_event::update, 1, 7, "{}")));
    item lost;
    lost.kind = feed_event::lost;
    lost.text = "the link was \"lost\"";
    BOOST_TEST(c.take(lost) == "event: lost\ndata: {\"reason\":\"the link was \\\"lost\\\"\"}\n\n");
    item rebound;
    rebound.kind = feed_event::rebound;
    BOOST_TEST(c.take(rebound) == "event: rebound\ndata: {}\n\n");
    BOOST_TEST(c.take(update_events::value(feed_event::current, 4, 7, "{}")) ==
               "event: gap\ndata: {\"missed\":2}\n\nid: 00000007.4\ndata: {}\n\n");
}

BOOST_AUTO_TEST_CASE(of_all_nodes_each_value_names_its_node) {
    client c{{}, false, true};
    BOOST_TEST(c.take(update_events::value(
                   feed_event::current, 0, 0,
                   R"({"results":{"car1":{"v":1},"car2":{}},"errors":{"car3":{"error":"denied"}}})")) ==
               "data: {\"node\":\"car1\",\"update\":{\"v\":1}}\n\n"
               "event: failure\ndata: {\"node\":\"car3\",\"failure\":{\"error\":\"denied\"}}\n\n");
    auto update = update_events::value(feed_event::update, 5, 7, "{\"v\":2}");
    update.publisher = "car2";
    BOOST_TEST(c.take(update) == "data: {\"node\":\"car2\",\"update\":{\"v\":2}}\n\n");
}

BOOST_AUTO_TEST_SUITE_END()
