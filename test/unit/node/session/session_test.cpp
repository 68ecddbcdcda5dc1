// SPDX-License-Identifier: BSL-1.0
#include "node/session/session.hpp"
#include "support/sent_request.hpp"
#include "support/session_fixture.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace session {
namespace {

using cles::feed_event;
using cles::verb;

/// Records what a subscription on the link receives.
class listener final : public cles::core::subscription {
  public:
    using subscription::subscription;
    std::string heard;

  private:
    bool on_event(const cles::detail::raw_event& event, cles::core::feed_mailbox::hand_over) override {
        if (!event.has_json()) {
            return false;
        }
        if (event.kind == feed_event::gap) {
            heard += "gap" + std::to_string(event.missed) + " ";
        } else {
            heard += std::to_string(event.seq) + std::string{event.body} + " ";
        }
        return true;
    }
};

struct fixture {
    fixture() {
        node.on(verb::pull, "speed", "{\"v\":3}");
        node.on(verb::push, "log", std::string{});
    }
    const cles::core::counters& counts() { return node.counts(); }

    cles::test::test_node node;
    cles::test::test_link link{node};
};

} // namespace
} // namespace session

BOOST_FIXTURE_TEST_SUITE(session, fixture)

BOOST_AUTO_TEST_SUITE(lines)

BOOST_AUTO_TEST_CASE(a_request_is_answered_with_one_line) {
    BOOST_TEST(link.ask("PULL car1:speed") == "{\"v\":3}\n");
    BOOST_TEST(link.ask("PULL car1:speed id=7") == "id=7 {\"v\":3}\n");
}

BOOST_AUTO_TEST_CASE(a_cr_before_the_lf_is_dropped_and_so_is_sp_at_either_end) {
    for (const std::string_view line :
         {"PULL car1:speed\r", "  PULL car1:speed", "PULL car1:speed   ", "  PULL  car1:speed  \r"}) {
        BOOST_TEST(link.ask(line) == "{\"v\":3}\n", "'" << line << "'");
    }
}

BOOST_AUTO_TEST_CASE(an_empty_line_is_ignored) {
    for (const std::string_view line : {"", "\r", " ", "   \r"}) {
        BOOST_TEST(link.ask(line).empty(), "'" << line << "'");
    }
    BOOST_TEST(counts().errors == 0U);
}

BOOST_AUTO_TEST_CASE(tab_is_not_sp) {
    BOOST_TEST(link.kind("PULL\tcar1:speed") == "bad_request");
    BOOST_TEST(link.kind("\t") == "bad_request");
    BOOST_TEST(link.kind("PULL car1:speed\t") == "bad_request");
}

BOOST_AUTO_TEST_CASE(verbs_come_in_any_case_and_names_do_not) {
    BOOST_TEST(link.kind("pull car1:speed") == "ok");
    BOOST_TEST(link.kind("PuLl car1:speed") == "ok");
    BOOST_TEST(link.kind("PULL car1:Speed") == "no_task");
    BOOST_TEST(link.kind("PULL Car1:speed") == "no_target");
}

BOOST_AUTO_TEST_CASE(requests_and_replies_cross_one_link_in_both_directions) {
    auto [operation, result] = cles::test::record();
    const auto now = node.clock.now();
    link.session().asking().send({.verb = verb::pull, .noun = "car2:load", .id = 7}, now + std::chrono::seconds{5}, now,
                                 std::move(operation));
    BOOST_TEST(link.take() == "PULL car2:load id=7\n");
    BOOST_TEST(link.ask("PULL car1:speed id=7") == "id=7 {\"v\":3}\n"); // the ids of the two directions are independent
    BOOST_TEST(!result->ended);
    link.ask("id=7 [4]");
    BOOST_TEST(result->text == "[4]");
}

BOOST_AUTO_TEST_CASE(a_reply_is_never_answered) {
    for (const std::string_view line :
         {"{}", "[", "id=7 {}", "id=", "id=7 5", "{\"error\":\"busy\"}", "id=x PULL car1:speed"}) {
        BOOST_TEST(link.ask(line).empty(), line);
    }
    BOOST_TEST(counts().replies_dropped == 7U);
    BOOST_TEST(counts().errors == 0U);
}

BOOST_AUTO_TEST_CASE(what_is_dropped_is_logged_once_a_minute) {
    std::vector<std::string> logged;
    cles::test::test_node hearing{{}, {}, [&](cles::log_level level, const cles::log_entry& entry) {
                                      const bool loud = level == cles::log_level::warning;
                                      logged.push_back((loud ? "warning: " : "debug: ") + std::string{entry.text});
                                  }};
    cles::test::test_link from{hearing};
    const auto last = [&] { return logged.empty() ? std::string{} : logged.back(); };

    const auto asked = cles::test::send_on(from, hearing, {.verb = verb::pull, .noun = "car2:tree", .id = 7});
    from.ask("id=7 " + std::string(36, '[') + std::string(36, ']'));
    BOOST_TEST(!asked->ended);
    BOOST_TEST(last().starts_with("warning: dropped a reply of 127.0.0.1: its body is no JSON: nested deeper than 35"),
               last());
    from.ask("id=7 {\"a\":}");
    from.ask("id=x {}");
    BOOST_TEST(logged.size() == 1U);
    from.ask("id=9 {}"); // of another kind: nobody may be to blame
    BOOST_TEST(last() == "debug: dropped a reply of 127.0.0.1: nobody waits for it");
    hearing.clock.advance(std::chrono::minutes{1});
    from.ask("id=x {}");
    BOOST_TEST(last() ==
               "warning: dropped a reply of 127.0.0.1: it has no valid head (and 2 since the last such line)");

    hearing.clock.advance(std::chrono::minutes{1});
    listener bound{"car2", "speed", false, 16};
    from.session().bound().add(bound);
    from.ask("UPDATE car2:speed seq=1 epoch=00000001 {\"v\":\"\xFF\"}");
    BOOST_TEST(last() == "warning: dropped an update of 127.0.0.1: its body is no JSON: invalid UTF-8 in a string (at "
                         "byte 6)");
    from.ask("UPDATE car2:speed seq=1 epoch=00000001 {}");
    from.ask("UPDATE car2:speed seq=1 epoch=00000001 {}");
    BOOST_TEST(last() == "debug: dropped an update of 127.0.0.1: it is old, or repeated");
    BOOST_TEST(hearing.counts().replies_dropped == 5U);
    BOOST_TEST(hearing.counts().updates_dropped == 2U);
    from.session().bound().remove(bound);
}

BOOST_AUTO_TEST_CASE(http_closes_the_link_without_a_reply) {
    for (const std::string_view line :
         {"POST / HTTP/1.1", "GET /cles HTTP/1.0\r", "Host: localhost:25370", "host: x", "PULL car1:speed HTTP/1.1"}) {
        cles::test::test_link web{node};
        BOOST_TEST(web.ask(line).empty(), line);
        BOOST_TEST(web.closes == 1, line);
        BOOST_TEST(web.ask("PULL car1:speed").empty(), line); // nothing after it is read
    }
}

BOOST_AUTO_TEST_CASE(web_clients_do_not_fill_the_log) {
    std::vector<std::string> logged;
    cles::test::test_node hearing{
        {}, {}, [&](cles::log_level, const cles::log_entry& entry) { logged.emplace_back(entry.text); }};
    const auto come = [&](int clients) {
        for (int i = 0; i < clients; ++i) {
            cles::test::test_link{hearing}.ask("GET / HTTP/1.1");
        }
    };
    come(20);
    BOOST_TEST(logged == (std::vector<std::string>{"rejected a web client: tcp://127.0.0.1:1"}),
               boost::test_tools::per_element());
    hearing.clock.advance(std::chrono::minutes{1});
    come(1);
    BOOST_TEST(logged.back() == "rejected a web client: tcp://127.0.0.1:1 (and 19 since the last such line)");
}

BOOST_AUTO_TEST_CASE(a_datagram_with_http_is_not_answered) {
    const std::string head =
        "GET / HTTP/1.1\r\nHost: 127.0.0.1:25370\r\nUser-Agent: curl/7.88.1\r\nAccept: */*\r\n\r\n";
    for (const auto& datagram :
         {std::string{"GET / HTTP/1.1"}, head, head + "x=1", std::string{"POST /a HTTP/1.0\n\n{}"},
          std::string{"M-SEARCH * HTTP/1.1\r\nHOST: 239.255.255.250:1900\r\nMAN: \"ssdp:discover\"\r\n\r\n"},
          std::string{"PULL car1:speed\nHost: x\n"}}) {
        cles::test::test_link web{node, 1200};
        BOOST_TEST(web.ask(datagram).empty(), datagram);
        BOOST_TEST(web.closes == 0, datagram);
    }
    cles::test::test_link web{node, 1200};
    web.overlong(head + std::string(1200, 'x')); // such as its cookies
    BOOST_TEST(web.take().empty());
    BOOST_TEST(web.kind("PULL car1:speed\nPULL car1:speed\n") == "bad_request"); // other ones are answered
    web.overlong("PUSH car1:log {\"x");
    BOOST_TEST(web.sent() == "too_large");
}

BOOST_AUTO_TEST_CASE(http_ends_running_requests) {
    node.on_later(verb::delegate, "work");
    link.ask("DELEGATE car1:work id=7");
    BOOST_TEST(link.ask("POST / HTTP/1.1").empty());
    BOOST_TEST(node.started.at(0)->stopped);
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE(updates)

BOOST_AUTO_TEST_CASE(an_update_is_accepted_only_from_the_link_that_bound_it) {
    listener speed{"car2", "speed", false, 16};
    link.session().bound().add(speed);
    link.ask("UPDATE car2:speed seq=1 epoch=0000000a {\"v\":1}");
    link.ask("UPDATE car3:speed seq=2 epoch=0000000a {\"v\":2}");
    link.ask("UPDATE car2:speed/left seq=3 epoch=0000000a {\"v\":3}");
    link.ask("UPDATE car2:load seq=4 epoch=0000000a {\"v\":4}");
    BOOST_TEST(speed.heard == "1{\"v\":1} ");
    BOOST_TEST(counts().updates_received == 1U);
    BOOST_TEST(counts().updates_dropped == 3U);

    cles::test::test_link other{node};
    other.ask("UPDATE car2:speed seq=5 epoch=0000000a {}");
    BOOST_TEST(speed.heard == "1{\"v\":1} ");
}

BOOST_AUTO_TEST_CASE(an_update_is_never_answered) {
    for (const std::string_view line :
         {"UPDATE car2:speed seq=1 epoch=0000000a {}", "UPDATE car2:speed seq=2 epoch=0000000a id=7 {}",
          "UPDATE car1:speed seq=3 epoch=0000000a {bad", "UPDATE car2:speed seq=4 epoch=0000000a {\"error\":\"x\"}",
          "UPDATE car2speed seq=5 epoch=0000000a {}", "UPDATE car2:speed seq=6 epoch=0000000a deadline=0 {}",
          "UPDATE car2:speed seq=7 epoch=0000000a must_x=1 id=8 {}"}) {
        BOOST_TEST(link.ask(line).empty(), line);
    }
}

BOOST_AUTO_TEST_CASE(an_update_with_a_malformed_body_is_dropped_and_appears_as_a_gap) {
    listener speed{"car2", "speed", false, 16};
    link.session().bound().add(speed);
    link.ask("UPDATE car2:speed seq=1 epoch=0000000a {}");
    link.ask("UPDATE car2:speed seq=2 epoch=0000000a {\"v\":}");
    link.ask("UPDATE car2:speed seq=3 epoch=0000000a {\"error\":1}");
    link.ask("UPDATE car2:speed seq=4 epoch=0000000a [\"\xFF\"]");
    link.ask("UPDATE car2:speed seq=5 epoch=0000000a {}");
    BOOST_TEST(speed.heard == "1{} gap3 5{} ");
    BOOST_TEST(counts().updates_dropped == 3U);
}

BOOST_AUTO_TEST_CASE(each_update_of_a_stream_is_checked) {
    listener speed{"car2", "speed", false, 16};
    link.session().bound().add(speed);
    for (int seq = 1; seq <= 4; ++seq) {
        link.ask("UPDATE car2:speed seq=" + std::to_string(seq) + " epoch=0000000a {}");
    }
    link.ask("UPDATE car2:speed seq=4 epoch=0000000a {}");
    link.ask("UPDATE car2:speed seq=5 epoch=0000000a {\"v\":}");
    link.ask("UPDATE car2:speed seq=6 epoch=0000000a {\"error\":1}");
    link.ask("UPDATE car2:speed seq=7 epoch=0000000a {}\r");
    link.ask("UPDATE car2:speed seq=8 epoch=0000000a {}");
    link.ask("UPDATE car2:load seq=9 epoch=0000000a {}");
    link.ask("UPDATE car2:speed seq=1 epoch=0000000b {}");
    link.ask("UPDATE car2:speed seq=9 epoch=0000000a {}");
    link.ask("UPDATE car2:speed seq=2 epoch=0000000b {}");
    BOOST_TEST(speed.heard == "1{} 2{} 3{} 4{} gap2 7{} 8{} 1{} 2{} ");
    BOOST_TEST(counts().updates_received == 8U);
    BOOST_TEST(counts().updates_dropped == 5U);

    link.session().bound().remove(speed);
    link.ask("UPDATE car2:speed seq=3 epoch=0000000b {}");
    BOOST_TEST(counts().updates_dropped == 6U);
    listener again{"self", "speed", false, 16};
    link.session().bound().add(again);
    for (int seq = 4; seq <= 7; ++seq) {
        link.ask("UPDATE car2:speed seq=" + std::to_string(seq) + " epoch=0000000b {}");
    }
    link.session().bound().remove(again);
    listener closer{"car2", "speed", false, 16};
    link.session().bound().add(closer);
    link.ask("UPDATE car2:speed seq=8 epoch=0000000b {}");
    BOOST_TEST(again.heard == "4{} 5{} 6{} 7{} ");
    BOOST_TEST(closer.heard == "8{} ");
}

BOOST_AUTO_TEST_CASE(an_old_or_repeated_update_is_dropped_and_counted) {
    listener speed{"car2", "speed", false, 16};
    link.session().bound().add(speed);
    link.ask("UPDATE car2:speed seq=5 epoch=0000000a");
    link.ask("UPDATE car2:speed seq=5 epoch=0000000a");
    link.ask("UPDATE car2:speed seq=4 epoch=0000000a");
    BOOST_TEST(speed.heard == "5{} ");
    BOOST_TEST(counts().updates_dropped == 2U);
}

BOOST_AUTO_TEST_CASE(an_update_of_a_restarted_publisher_is_new_and_older_ones_are_dropped) {
    listener speed{"car2", "speed", false, 16};
    link.session().bound().add(speed);
    link.ask("UPDATE car2:speed seq=90 epoch=0000000a");
    link.ask("UPDATE car2:speed seq=2 epoch=0000000b");
    link.ask("UPDATE car2:speed seq=91 epoch=0000000a");
    BOOST_TEST(speed.heard == "90{} 2{} ");
}

BOOST_AUTO_TEST_CASE(nouns_of_updates_are_compared_decoded) {
    listener log{"car2", "log/aA", false, 16};
    link.session().bound().add(log);
    link.ask("UPDATE car2:log/a%41 seq=1 epoch=0000000a");
    BOOST_TEST(log.heard == "1{} ");
}

BOOST_AUTO_TEST_CASE(an_update_with_only_one_of_seq_and_epoch_is_bad_request) {
    BOOST_TEST(link.kind("UPDATE car1:speed seq=1 {}") == "bad_request");
    BOOST_TEST(link.kind("UPDATE car1:speed epoch=0000000a {}") == "bad_request");
    BOOST_TEST(link.kind("UPDATE car1:speed epoch=0000000a seq=0 id=7 {}") == "id=7 bad_request");
}

BOOST_AUTO_TEST_SUITE_END()

BOOST_AUTO_TEST_SUITE_END()
