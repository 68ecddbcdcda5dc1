// SPDX-License-Identifier: BSL-1.0
// Nodes that discover each other in a multicast group on loopback, and requests by name without a configured URL.

#include <cles/routing.hpp>
#include <cles/service.hpp>

#include "support/feed_log.hpp"
#include "support/group_address.hpp"
#include "support/group_repeater.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/buffer.hpp>
#include <boost/asio/cancellation_signal.hpp>
#include <boost/asio/ip/multicast.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

BOOST_AUTO_TEST_SUITE(membership)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;
using asio::ip::udp;
using cles::errc;
using cles::peer_state;

namespace {

/// Sends to the group from a plain socket.
class speaker {
  public:
    speaker(asio::io_context& io, const cles::multicast_options& where)
        : socket_(io, udp::endpoint{asio::ip::make_address("127.0.0.1"), 0}),
          group_(asio::ip::make_address(where.group), where.port) {
        socket_.set_option(asio::ip::multicast::outbound_interface(asio::ip::address_v4::loopback()));
    }
    void say(const std::string& line) { socket_.send_to(asio::buffer(line), group_); }
    void announce(const std::string& node, const std::string& body, const std::string& epoch = "0000beef") {
        say("UPDATE " + node + ":cles seq=" + std::to_string(++seq_) + " epoch=" + epoch + " " + body);
    }

  private:
    udp::socket socket_;
    udp::endpoint group_;
    int seq_ = 0;
};

struct fixture {
    [[nodiscard]] cles::service_options in_group(std::string name) const {
        cles::service_options options{.name = std::move(name)};
        options.multicast = where;
        options.log = [this](cles::log_level level, std::string_view text) {
            if (level == cles::log_level::warning) {
                warnings.emplace_back(text);
            }
        };
        return options;
    }
    /// On a separate context, so that it is discovered only by its announcements.
    std::unique_ptr<cles::service> serving(const std::string& name, const std::string& at = "tcp://127.0.0.1:0") {
        auto options = in_group(name);
        options.listen = {at};
        auto made = std::make_unique<cles::service>(there, std::move(options));
        made->on_pull("who", [name] { return name; });
        return made;
    }
    /// Runs both contexts until the condition holds.
    template <class Condition>
    void until(Condition&& holds) {
        run_until(here, [&] {
            there.restart();
            there.poll();
            return holds();
        });
    }
    static const cles::peer* find(const std::vector<cles::peer>& all, std::string_view name) {
        const auto at = std::find_if(all.begin(), all.end(), [&](const auto& p) { return p.node == name; });
        return at == all.end() ? nullptr : &*at;
    }
    bool knows(const cles::service& s, std::string_view name) { return find(s.peers(), name) != nullptr; }

    std::uint64_t count_of(cles::service& node, const std::string& counter) {
        const auto all = pulled(node, "self:cles/metrics").text;
        const auto key = "\"" + counter + "\":";
        return std::stoull(all.substr(all.find(key) + key.size()));
    }
    std::uint64_t announcements_sent(cles::service& of) { return count_of(of, "announcements_sent"); }

    struct outcome {
        bool ended = false;
        boost::system::error_code code;
        std::string text;
        std::string why;
    };
    std::shared_ptr<outcome> pull(cles::service& from, const std::string& noun) {
        auto result = std::make_shared<outcome>();
        cles::call_options options;
        options.diagnostics(result->why);
        from.async_pull(noun, options, [result](boost::system::error_code code, const cles::json_text& reply) {
            result->ended = true;
            result->code = code;
            result->text = reply.text;
        });
        return result;
    }
    outcome pulled(cles::service& from, const std::string& noun) {
        const auto result = pull(from, noun);
        until([&] { return result->ended; });
        return *result;
    }

    mutable std::vector<std::string> warnings;
    cles::multicast_options where = fresh_group();
    asio::io_context here;
    asio::io_context there;
};

} // namespace

BOOST_FIXTURE_TEST_CASE(a_name_is_found_by_the_first_request, fixture) {
    const auto car1 = serving("car1");
    cles::service asker{here, in_group("asker")};
    const auto begun = std::chrono::steady_clock::now();
    const auto answer = pulled(asker, "car1:who"); // nothing had been received when it was asked
    BOOST_TEST(!answer.code);
    BOOST_TEST(answer.text == R"({"value":"car1"})");
    BOOST_TEST((std::chrono::steady_clock::now() - begun < patience));
}

BOOST_FIXTURE_TEST_CASE(a_name_is_called_and_answers_without_the_jitter_of_a_round, fixture) {
    const auto car1 = serving("car1");
    until([&] { return announcements_sent(*car1) == 1; });
    speaker caller{here, where};
    const auto asked = std::chrono::steady_clock::now();
    for (std::uint64_t i = 2; i < 12; ++i) {
        caller.say("BIND another:cles");
        caller.say("BIND car1:cles");
        until([&] { return announcements_sent(*car1) >= i; });
    }
    const auto took = std::chrono::steady_clock::now() - asked;
    BOOST_TEST((took >= 900ms)); // there is a pause between any two
    BOOST_TEST((took < 6s));     // ten intervals are longer
}

BOOST_FIXTURE_TEST_CASE(many_requests_wait_together, fixture) {
    const auto car1 = serving("car1");
    cles::service asker{here, in_group("asker")};
    std::vector<std::shared_ptr<outcome>> all;
    for (int i = 0; i < 20; ++i) {
        all.push_back(pull(asker, "car1:who"));
    }
    until([&] { return std::all_of(all.begin(), all.end(), [](const auto& r) { return r->ended && !r->code; }); });
}

BOOST_FIXTURE_TEST_CASE(a_feed_is_bound_by_name_and_again_where_the_node_has_moved, fixture) {
    auto car1 = serving("car1");
    car1->update("position", 1);
    cles::service asker{here, in_group("asker")};
    feed_log log;
    log.bind(asker, "car1:position");
    until([&] { return log.bound; });
    const auto before = car1->endpoints().front();
    car1->stop();
    car1 = serving("car1"); // another incarnation, at another port
    BOOST_TEST(car1->endpoints().front() != before);
    car1->update("position", 2);
    until([&] { return log.count(cles::feed_event::rebound) == 1; });
}

BOOST_FIXTURE_TEST_CASE(after_the_first_round_an_unknown_name_is_refused_at_once, fixture) {
    cles::service asker{here, in_group("asker")};
    const auto first = pulled(asker, "car9:who");
    BOOST_TEST((first.code == errc::no_target));
    BOOST_TEST(first.why ==
               "asker cannot find 'car9': no node with that name has announced itself on lo; give its URL");
    const auto second = pull(asker, "car9:who");
    here.restart();
    here.poll();
    here.poll();
    BOOST_TEST(second->ended); // without waiting
    BOOST_TEST((second->code == errc::no_target));
}

BOOST_FIXTURE_TEST_CASE(what_waits_for_a_name_can_be_withdrawn_and_ends_with_the_service, fixture) {
    std::optional<cles::service> asker{std::in_place, here, in_group("asker")};
    const auto waits = pull(*asker, "car9:who");
    asio::cancellation_signal withdraw;
    boost::system::error_code withdrawn;
    asker->async_pull("car9:who",
                      asio::bind_cancellation_slot(withdraw.slot(), [&](boost::system::error_code code,
                                                                        const cles::json_text&) { withdrawn = code; }));
    withdraw.emit(asio::cancellation_type::terminal);
    until([&] { return bool{withdrawn}; });
    BOOST_TEST((withdrawn == errc::cancelled));
    asker.reset();
    until([&] { return waits->ended; });
    BOOST_TEST((waits->code == errc::stopped));
}

BOOST_FIXTURE_TEST_CASE(configured_addresses_precede_announced_ones, fixture) {
    const auto car1 = serving("car1");
    const auto other = serving("other");
    auto options = in_group("asker");
    options.peers.emplace("car1", other->endpoints().front());
    cles::service asker{here, std::move(options)};
    until([&] { return knows(asker, "car1"); });
    BOOST_TEST((pulled(asker, "car1:who").code == errc::no_target)); // the other reports that it is not car1
    asker.set_peer("car1", "");
    BOOST_TEST(pulled(asker, "car1:who").text == R"({"value":"car1"})");
}

BOOST_FIXTURE_TEST_CASE(a_name_that_is_configured_meanwhile_is_waited_for_no_more, fixture) {
    auto options = in_group("other");
    options.multicast.interface.clear();
    options.listen = {"tcp://127.0.0.1:0"};
    cles::service silent{there, std::move(options)};
    silent.on_pull("who", [] { return "silent"; });
    cles::service asker{here, in_group("asker")};
    const auto answer = pull(asker, "other:who");
    asker.set_peer("other", silent.endpoints().front());
    until([&] { return answer->ended; });
    BOOST_TEST(answer->text == R"({"value":"silent"})");
}

BOOST_FIXTURE_TEST_CASE(what_is_urgent_stays_so_while_it_waits_for_a_name, fixture) {
    cles::test::scripted_listener listener{here};
    cles::service asker{here, in_group("asker")};
    asker.async_pull("other:who", cles::call_options{}.urgent(),
                     [](boost::system::error_code, const cles::json_text&) {});
    asker.set_peer("other", listener.url());
    const auto line = listener.accept().line();
    BOOST_TEST(line.find(" urgent=yes") != std::string::npos, line);
}

BOOST_FIXTURE_TEST_CASE(nodes_know_each_other_and_list_their_peers, fixture) {
    const auto car1 = serving("car1");
    const auto car2 = serving("car2", "udp://127.0.0.1:0");
    until([&] { return knows(*car1, "car2") && knows(*car2, "car1"); });
    BOOST_TEST(car1->peers().size() == 1U); // without itself
    const auto p = car1->peers().front();
    BOOST_TEST(p.endpoints == car2->endpoints(), boost::test_tools::per_element());
    BOOST_TEST((p.state == peer_state::live));
    BOOST_TEST(p.tasks.size() == 16U);
    const auto told = pulled(*car1, "self:cles/peers").text;
    BOOST_TEST(told.starts_with("{\"peers\":[{\"node\":\"car2\",\"endpoints\":[\"" + car2->endpoints().front() +
                                "\"],\"epoch\":\"" + p.epoch + "\",\"age_ms\":"));
    BOOST_TEST(told.ends_with(",\"state\":\"live\",\"load\":{\"queued\":0,\"running\":0,\"workers\":0}}]}"));
}

BOOST_FIXTURE_TEST_CASE(a_node_that_listens_nowhere_is_not_announced, fixture) {
    const auto car1 = serving("car1");
    cles::service asker{here, in_group("asker")};
    until([&] { return knows(asker, "car1"); });
    BOOST_TEST(!knows(*car1, "asker"));
    asker.listen("tcp://127.0.0.1:0");
    until([&] { return knows(*car1, "asker"); });
}

BOOST_FIXTURE_TEST_CASE(without_multicast_no_node_is_known, fixture) {
    const auto car1 = serving("car1");
    cles::service alone{here, {.name = "alone"}};
    const auto answer = pulled(alone, "car1:who");
    BOOST_TEST((answer.code == errc::no_target));
    BOOST_TEST(answer.why == "alone cannot find 'car1': give its URL");
    BOOST_TEST(pulled(alone, "self:cles/peers").text == R"({"peers":[]})");
}

BOOST_FIXTURE_TEST_CASE(a_new_task_changes_the_digest_that_is_announced, fixture) {
    const auto car1 = serving("car1");
    cles::service asker{here, in_group("asker")};
    until([&] { return knows(asker, "car1"); });
    const auto digest = [&] { return find(asker.peers(), "car1")->tasks; };
    const auto before = digest();
    car1->on_pull("speed", [] { return 1; });
    until([&] { return digest() != before; });
    const auto then = digest();
    car1->update("position", 1);
    until([&] { return digest() != then; });
}

BOOST_FIXTURE_TEST_CASE(a_stopped_node_is_known_no_more, fixture) {
    const auto car1 = serving("car1");
    cles::service asker{here, in_group("asker")};
    until([&] { return knows(asker, "car1"); });
    BOOST_TEST(!pulled(asker, "car1:who").code);
    pulled(asker, "car9:who"); // the first round is over
    car1->stop();
    until([&] { return !knows(asker, "car1"); }); // long before silence would reveal it
    BOOST_TEST((pulled(asker, "car1:who").code == errc::no_target));
}

BOOST_FIXTURE_TEST_CASE(one_that_leaves_is_known_no_more_and_still_answers_and_asks, fixture) {
    const auto car1 = serving("car1");
    auto options = in_group("asker");
    options.listen = {"tcp://127.0.0.1:0"};
    cles::service asker{here, std::move(options)};
    asker.on_pull("who", [] { return "asker"; });
    until([&] { return knows(asker, "car1") && knows(*car1, "asker"); });
    car1->leave();
    until([&] { return !knows(asker, "car1"); });

    std::string answer;
    const auto there_itself = cles::call_options{}.at(car1->endpoints().front());
    asker.async_pull("self:who", there_itself, [&](auto, const cles::json_text& reply) { answer = reply.text; });
    const auto onward = pull(*car1, "asker:who");
    until([&] { return !answer.empty() && onward->ended; });
    BOOST_TEST(answer == R"({"value":"car1"})");
    BOOST_TEST(onward->text == R"({"value":"asker"})");

    // No request makes it reveal its presence.
    const auto before = announcements_sent(*car1);
    speaker somebody{here, where};
    somebody.say("BIND car1:cles");
    somebody.say("BIND all:cles");
    somebody.announce("last", R"({"endpoints":["tcp://127.0.0.1:9"]})");
    until([&] { return knows(*car1, "last"); });
    BOOST_TEST(announcements_sent(*car1) == before);
    car1->stop();
    BOOST_TEST(!knows(asker, "car1"));
}

BOOST_FIXTURE_TEST_CASE(a_silent_node_is_suspect_and_then_gone, fixture) {
    cles::service asker{here, in_group("asker")};
    speaker car1{here, where};
    car1.announce("car1", R"({"interval_ms":250,"endpoints":["tcp://127.0.0.1:9"]})");
    const auto state = [&] {
        const auto all = asker.peers();
        const auto* p = find(all, "car1");
        return p == nullptr ? std::string{"gone"} : std::string{to_string(p->state)};
    };
    until([&] { return state() == "live"; });
    until([&] { return state() == "suspect"; });
    until([&] { return state() == "gone"; });
}

BOOST_FIXTURE_TEST_CASE(one_who_is_killed_and_starts_again_elsewhere_is_found_again, fixture) {
    cles::service asker{here, in_group("asker")};
    {
        speaker dead{here, where}; // sends no farewell
        dead.announce("car1", R"({"interval_ms":250,"endpoints":["tcp://127.0.0.1:9"]})");
        until([&] { return knows(asker, "car1"); });
    }
    const auto car1 = serving("car1");
    until([&] { return find(asker.peers(), "car1")->endpoints == car1->endpoints(); });
    BOOST_TEST(pulled(asker, "car1:who").text == R"({"value":"car1"})");
    BOOST_TEST(warnings.empty());
}

BOOST_FIXTURE_TEST_CASE(a_second_live_node_of_a_name_is_reported_and_not_asked, fixture) {
    const auto car1 = serving("car1");
    cles::service asker{here, in_group("asker")};
    until([&] { return knows(asker, "car1"); });
    speaker second{here, where};
    const auto has_clash = [](const cles::service& s) {
        const auto all = s.peers();
        return std::any_of(all.begin(), all.end(), [](const auto& p) { return p.state == peer_state::clash; });
    };
    auto next = std::chrono::steady_clock::now();
    until([&] {
        if (std::chrono::steady_clock::now() >= next) {
            next += 100ms;
            second.announce("car1", R"({"endpoints":["tcp://127.0.0.1:9"]})");
            second.say("BIND all:cles");
        }
        return has_clash(asker) && has_clash(*car1);
    });
    BOOST_TEST(pulled(asker, "car1:who").text == R"({"value":"car1"})");
    BOOST_TEST(std::count(warnings.begin(), warnings.end(),
                          "a second node has the name 'car1', on 127.0.0.1, and gets no requests") == 1);
    BOOST_TEST(std::count(warnings.begin(), warnings.end(), "another node also has the name 'car1', on 127.0.0.1") ==
               1);
    BOOST_TEST(pulled(asker, "self:cles/peers").text.find(R"("state":"clash")") != std::string::npos);
}

BOOST_FIXTURE_TEST_CASE(the_first_of_two_live_nodes_of_a_name_keeps_its_requests, fixture) {
    const auto car1 = serving("car1");
    auto options = in_group("asker");
    options.routing = cles::routing();
    cles::service asker{here, std::move(options)};
    until([&] { return knows(asker, "car1"); });
    asio::io_context third;
    auto of_second = in_group("car1");
    of_second.listen = {"tcp://127.0.0.1:0"};
    cles::service second{third, std::move(of_second)};
    second.on_pull("who", [] { return std::string{"the second"}; });
    until([&] {
        third.restart();
        third.poll();
        return asker.peers().size() == 2;
    });
    BOOST_TEST((asker.peers()[1].state == peer_state::clash));
    const auto answer = pulled(asker, "car1:who");
    BOOST_TEST(answer.text == R"({"value":"car1"})");
    BOOST_TEST(answer.why ==
               "a second node has the name 'car1', at " + second.endpoints().front() + ", and gets no requests");
    BOOST_TEST(pulled(asker, "any:who").text == R"({"value":"car1"})");
    BOOST_TEST(pulled(asker, "all:who").text == R"({"results":{"car1":{"value":"car1"}},"errors":{}})");
}

BOOST_FIXTURE_TEST_CASE(a_program_that_repeats_the_group_makes_no_conflict, fixture) {
    const group_repeater repeater{here, where};
    const auto car1 = serving("car1");
    cles::service asker{here, in_group("asker")};
    until([&] { return knows(asker, "car1"); });
    until([&] { return count_of(asker, "group_copied") > 2; });
    BOOST_TEST(pulled(asker, "car1:who").text == R"({"value":"car1"})");
    BOOST_TEST(asker.peers().size() == 1U);
    BOOST_TEST(car1->peers().empty());
    BOOST_TEST(warnings.empty());
}

BOOST_FIXTURE_TEST_CASE(what_is_malformed_is_counted_and_otherwise_without_effect, fixture) {
    cles::service asker{here, in_group("asker")};
    speaker bad{here, where};
    bad.announce("car1", R"({"endpoints":7})");
    bad.announce("car1", R"({"node":"car2"})");
    bad.announce("car3", "{}");
    until([&] { return knows(asker, "car3"); });
    BOOST_TEST(asker.peers().size() == 1U);
    BOOST_TEST(pulled(asker, "self:cles/metrics").text.find(R"("announcements_dropped":2)") != std::string::npos);
    const auto nowhere = pulled(asker, "car3:who");
    BOOST_TEST((nowhere.code == errc::no_target));
    BOOST_TEST(nowhere.why ==
               "asker cannot find 'car3': it has announced no address that is reachable from here; state its URL "
               "in 'peers', or in 'links' a node that reaches it");
}

BOOST_FIXTURE_TEST_CASE(past_the_limit_nodes_are_passed_over, fixture) {
    auto options = in_group("asker");
    options.limits.peers = 2;
    cles::service asker{here, std::move(options)};
    speaker many{here, where};
    for (int i = 0; i < 5; ++i) {
        many.announce("car" + std::to_string(i), "{}");
    }
    until([&] { return pulled(asker, "self:cles/metrics").text.find(R"("peers_refused":3)") != std::string::npos; });
    BOOST_TEST(asker.peers().size() == 2U);
}

BOOST_FIXTURE_TEST_CASE(made_up_nodes_do_not_fill_the_log, fixture) {
    std::size_t lines = 0;
    auto options = in_group("asker");
    options.limits.peers = 4;
    options.log = [&](cles::log_level, std::string_view text) {
        lines += text.starts_with("discovered ") || text.ends_with(" has left") ? 1U : 0U;
    };
    cles::service asker{here, std::move(options)};
    speaker many{here, where};
    for (int i = 0; i < 20; ++i) {
        many.announce("car" + std::to_string(i), "{}");
        many.announce("car" + std::to_string(i), R"({"leaving":true})");
    }
    many.announce("last", "{}");
    until([&] { return knows(asker, "last") && lines >= 4; });
    (void)pulled(asker, "self:cles"); // what was posted before has run then
    BOOST_TEST(lines == 4U);
}

BOOST_AUTO_TEST_SUITE_END()
