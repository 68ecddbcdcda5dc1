// SPDX-License-Identifier: BSL-1.0
// The guarantees of a link that carries each line as a datagram.

#include <cles/error.hpp>

#include "support/data_test_case.hpp"
#include "support/link_pair.hpp"
#include "support/link_recorder.hpp"
#include "support/run_until.hpp"
#include "transport/udp.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <sys/socket.h>
#include <unistd.h>

BOOST_AUTO_TEST_SUITE(datagram_link)

using namespace cles::test;
namespace asio = boost::asio;
using asio::ip::udp;

namespace {

/// A plain socket that sends what a link never sends.
struct plain_socket {
    plain_socket(asio::io_context& io, const cles::url& where)
        : to{asio::ip::make_address(where.host), where.port}, socket{io, to.protocol()} {}
    void send(std::string_view datagram) { socket.send_to(asio::buffer(datagram.data(), datagram.size()), to); }

    udp::endpoint to;
    udp::socket socket;
};

using lines = std::vector<std::string>;

} // namespace

CLES_DATA_TEST_CASE(it_reports_the_size_of_a_datagram, every_datagram, kind) {
    link_pair pair{kind};
    pair.connect();
    BOOST_TEST(pair.near.link->datagram() == 1200U);
    BOOST_TEST(pair.far.link->datagram() == 1200U);
}

CLES_DATA_TEST_CASE(a_stream_reports_that_it_has_no_datagrams, every_carrier, kind) {
    link_pair pair{kind};
    pair.connect();
    BOOST_TEST(pair.near.link->datagram() == 0U);
    BOOST_TEST(pair.far.run([&] { return pair.far.link->datagram(); }) == 0U);
}

CLES_DATA_TEST_CASE(each_line_arrives_in_both_directions_with_a_separate_batch, every_datagram, kind) {
    link_pair pair{kind};
    pair.open();
    pair.near.say("one\ntwo\n");
    pair.until([&] { return pair.far.lines() == 3; });
    BOOST_TEST((pair.far.events->lines == lines{"hello", "one", "two"}));
    BOOST_TEST(pair.far.events->calls == "lblblb");
    pair.far.say("three\nfour\n");
    pair.until([&] { return pair.near.lines() == 2; });
    BOOST_TEST((pair.near.events->lines == lines{"three", "four"}));
    BOOST_TEST(pair.near.unsent() == 0U);
    BOOST_TEST(pair.near.link->sent() == std::string{"hello\none\ntwo\n"}.size());
    BOOST_TEST(pair.far.link->received() == pair.near.link->sent());
}

CLES_DATA_TEST_CASE(the_lf_at_the_end_may_be_left_out, every_datagram, kind) {
    link_pair pair{kind};
    pair.open();
    plain_socket someone{pair.io, pair.address()};
    someone.send("PULL self:cles");
    pair.accept();
    pair.far.start();
    pair.until([&] { return pair.far.events->lines.size() == 2; });
    BOOST_TEST(pair.far.events->lines.back() == "PULL self:cles");
}

CLES_DATA_TEST_CASE(several_lines_in_one_datagram_are_handed_over_as_they_came, every_datagram, kind) {
    link_pair pair{kind};
    plain_socket someone{pair.io, pair.address()};
    someone.send("one\ntwo\n");
    pair.accept();
    pair.far.start();
    pair.until([&] { return pair.far.lines() == 1; });
    BOOST_TEST(pair.far.events->lines[0] == "one\ntwo"); // the session refuses it
}

CLES_DATA_TEST_CASE(an_empty_datagram_is_ignored_and_makes_no_link, every_datagram, kind) {
    link_pair pair{kind};
    plain_socket someone{pair.io, pair.address()};
    for (const auto* nothing : {"", "\n", "\r\n"}) {
        someone.send(nothing);
    }
    someone.send("x");
    pair.accept();
    pair.far.start();
    pair.until([&] { return pair.far.lines() == 1; });
    BOOST_TEST(pair.far.events->lines[0] == "x");
}

CLES_DATA_TEST_CASE(one_over_the_limit_is_reported_and_the_link_continues, every_datagram, kind) {
    link_pair pair{kind};
    plain_socket someone{pair.io, pair.address()};
    someone.send(std::string(1200, 'a'));
    someone.send(std::string(1201, 'b'));
    someone.send(std::string(9000, 'c'));
    someone.send("later");
    pair.accept();
    pair.far.start();
    pair.until([&] { return pair.far.lines() == 2; });
    BOOST_TEST(pair.far.events->calls == "lbobob"
                                         "lb");
    BOOST_TEST((pair.far.events->lines[0] == std::string(1200, 'a')));
    BOOST_TEST((pair.far.events->head == std::string(1200, 'c')));
}

CLES_DATA_TEST_CASE(each_source_is_a_link_of_its_own, every_datagram, kind) {
    link_pair pair{kind};
    std::vector<link_end> nears;
    std::vector<link_end> fars;
    for (int i = 0; i < 20; ++i) {
        pair.open();
        nears.push_back(std::exchange(pair.near, {}));
        fars.push_back(std::exchange(pair.far, {}));
    }
    for (std::size_t i = 0; i < nears.size(); ++i) {
        nears[i].say(std::to_string(i) + "\n");
        fars[i].say("back " + std::to_string(i) + "\n");
    }
    for (std::size_t i = 0; i < nears.size(); ++i) {
        pair.until([&] { return fars[i].lines() == 2 && nears[i].lines() == 1; });
        BOOST_TEST(fars[i].events->lines[1] == std::to_string(i));
        BOOST_TEST(nears[i].events->lines[0] == "back " + std::to_string(i));
    }
    for (auto& end : nears) {
        end.drop();
    }
    for (auto& end : fars) {
        end.drop();
    }
}

// A link that is started when its first datagram arrives, as services do, must not overwrite it with the next one.
BOOST_AUTO_TEST_CASE(what_waits_behind_the_first_datagram_of_a_source_leaves_it_whole) {
    asio::io_context io;
    const auto where = cles::parse_url(fresh_address(carrier::udp4));
    const auto door = cles::find_transport("udp")->listen(io.get_executor(), where, {});
    const auto events = std::make_shared<link_recorder>();
    door->start([&](const cles::link_ptr& link) { link->start(events); });
    plain_socket someone{io, door->local()};
    for (const auto* line : {"the first", "2nd", "a longer third"}) {
        someone.send(line);
    }
    run_until(io, [&] { return events->lines.size() == 3; });
    BOOST_TEST((events->lines == lines{"the first", "2nd", "a longer third"}));
}

CLES_DATA_TEST_CASE(a_dialled_link_receives_only_from_its_peer, every_datagram, kind) {
    link_pair pair{kind};
    pair.open();
    // The port of the near end is known to the far end.
    const auto near = cles::parse_url(pair.far.link->peer().address);
    plain_socket stranger{pair.io, near};
    stranger.send("a stranger's word");
    pair.far.say("the peer's word\n");
    pair.until([&] { return pair.near.lines() == 1; });
    run_ready(pair.io);
    BOOST_TEST((pair.near.events->lines == lines{"the peer's word"}));
}

CLES_DATA_TEST_CASE(a_flood_is_handed_over_in_turns, every_datagram, kind) {
    link_pair pair{kind};
    pair.open();
    std::string text;
    for (int i = 0; i < 600; ++i) {
        text += "x\n";
    }
    bool others_had_a_turn = false;
    std::size_t seen_by_others = 0;
    pair.far.events->hook = [&](char call) {
        if (call == 'l' && !others_had_a_turn) {
            others_had_a_turn = true;
            asio::post(pair.io, [&] { seen_by_others = pair.far.events->lines.size(); });
        }
    };
    pair.near.say(text); // as much as the kernel buffers; the rest is lost
    pair.until([&] { return pair.far.lines() > 300; });
    BOOST_TEST(others_had_a_turn);
    BOOST_TEST(seen_by_others > 0U);
    BOOST_TEST(seen_by_others <= 257U);
}

CLES_DATA_TEST_CASE(what_arrives_while_a_link_is_paused_is_lost, every_datagram, kind) {
    link_pair pair{kind};
    pair.open();
    pair.until([&] { return pair.far.lines() == 1; });
    pair.far.link->pause(true);
    pair.near.say("lost\n");
    run_ready(pair.io);
    pair.far.link->pause(false);
    pair.near.say("heard\n");
    pair.until([&] { return pair.far.lines() == 2; });
    BOOST_TEST(pair.far.events->lines[1] == "heard");
}

CLES_DATA_TEST_CASE(a_missing_listener_is_not_an_error, every_datagram, kind) {
    link_pair pair{kind};
    pair.stop_listening();
    cles::link_ptr made;
    pair.transport().dial(pair.io.get_executor(), pair.address(), pair.bounds(),
                          [&](boost::system::error_code code, cles::link_ptr link) {
                              BOOST_TEST(!code);
                              made = std::move(link);
                          });
    pair.until([&] { return made != nullptr; });
    pair.near.link = std::exchange(made, nullptr);
    pair.near.start();
    for (int i = 0; i < 5; ++i) { // the network reports that they are refused
        pair.near.say("hello?\n");
        run_ready(pair.io);
    }
    BOOST_TEST(!pair.near.over());
    asio::io_context other;
    const auto back = pair.transport().listen(other.get_executor(), pair.address(), pair.bounds());
    cles::link_ptr arrived;
    back->start([&](cles::link_ptr link) { arrived = std::move(link); });
    pair.near.say("hello again\n"); // with a listener again, the link continues
    run_until(other, [&] { return arrived != nullptr; });
    arrived->close();
}

CLES_DATA_TEST_CASE(links_outlive_their_acceptor_and_the_address_is_free_after_the_last, every_datagram, kind) {
    link_pair pair{kind};
    pair.open();
    pair.stop_listening();
    pair.near.say("still there\n");
    pair.until([&] { return pair.far.lines() == 2; });
    plain_socket late{pair.io, pair.address()};
    late.send("nobody comes in any more");
    run_ready(pair.io);
    pair.far.drop();
    BOOST_CHECK_NO_THROW(pair.transport().listen(pair.io.get_executor(), pair.address(), pair.bounds()));
}

CLES_DATA_TEST_CASE(a_closed_link_is_silent_and_its_source_may_make_a_new_one, every_datagram, kind) {
    link_pair pair{kind};
    pair.open();
    pair.until([&] { return pair.far.lines() == 1; });
    const auto first = std::exchange(pair.far, {});
    first.link->close();
    pair.near.say("again\n");
    pair.accept();
    pair.far.start();
    pair.until([&] { return pair.far.lines() == 1; });
    BOOST_TEST(first.events->calls == "lb");
}

CLES_DATA_TEST_CASE(to_finish_is_to_send_what_is_left_and_to_be_lost, every_datagram, kind) {
    link_pair pair{kind};
    pair.open();
    pair.until([&] { return pair.far.lines() == 1; });
    pair.far.link->output().append("bye\n");
    pair.far.link->finish();
    BOOST_TEST(!pair.far.lost()); // never inside the call
    pair.until([&] { return pair.far.lost() && pair.near.lines() == 1; });
    BOOST_TEST(pair.far.events->in_order());
}

CLES_DATA_TEST_CASE(an_owner_may_close_the_link_from_inside_its_line, every_datagram, kind) {
    link_pair pair{kind};
    pair.open();
    pair.far.events->hook = [&](char call) {
        if (call == 'l') {
            pair.far.link->close();
        }
    };
    pair.near.say("one\n");
    pair.until([&] { return pair.far.lines() >= 1; });
    run_ready(pair.io);
    BOOST_TEST(pair.far.events->calls == "l");
}

// Otherwise a caller that limits its output, and counts it on each flush, would count it again or not at all.
BOOST_AUTO_TEST_CASE(flushed_output_is_consumed_even_if_the_socket_is_not_writable) {
    asio::io_context io;
    std::array<int, 2> ends{}; // datagrams of a kind that wait for their reader
    BOOST_REQUIRE(::socketpair(AF_UNIX, SOCK_DGRAM, 0, ends.data()) == 0);
    const auto port = std::make_shared<cles::transport::udp_port>(udp::socket{io, udp::v4(), ends[0]});
    const auto link = port->connect_link({asio::ip::address_v4::loopback(), 1},
                                         {.transport = "udp", .address = {}, .name = {}, .uid = {}});
    const auto events = std::make_shared<link_recorder>();
    link->start(events);
    lines sent;
    for (int i = 0; i < 1000; ++i) {
        sent.push_back(std::to_string(i));
        link->output().append(sent.back()).append("\n");
        link->flush();
        BOOST_TEST(link->output().empty());
    }
    BOOST_TEST(link->unsent() > 0U);
    BOOST_TEST(!events->has('r'));
    lines arrived;
    run_until(io, [&] {
        std::array<char, 2000> text{};
        const auto count = ::recv(ends[1], text.data(), text.size(), MSG_DONTWAIT);
        if (count > 0) {
            arrived.emplace_back(text.data(), static_cast<std::size_t>(count) - 1);
        }
        return arrived.size() == sent.size();
    });
    BOOST_TEST((arrived == sent));
    run_until(io, [&] { return events->has('r'); });
    BOOST_TEST(link->unsent() == 0U);
    link->close();
    ::close(ends[1]);
}

// Also if one of them is gone meanwhile.
BOOST_AUTO_TEST_CASE(all_links_of_a_socket_go_on_when_it_is_writable) {
    asio::io_context io;
    std::array<int, 2> ends{};
    BOOST_REQUIRE(::socketpair(AF_UNIX, SOCK_DGRAM, 0, ends.data()) == 0);
    const auto port = std::make_shared<cles::transport::udp_port>(udp::socket{io, udp::v4(), ends[0]});
    std::vector<cles::link_ptr> links;
    std::vector<std::shared_ptr<link_recorder>> events;
    for (std::uint16_t number = 1; number <= 3; ++number) {
        links.push_back(port->connect_link({asio::ip::address_v4::loopback(), number},
                                           {.transport = "udp", .address = {}, .name = {}, .uid = {}}));
        events.push_back(std::make_shared<link_recorder>());
        links.back()->start(events.back());
    }
    while (links.front()->unsent() == 0) {
        links.front()->output().append("one\n");
        links.front()->flush();
    }
    for (const auto& each : links) {
        each->output().append("more\n");
        each->flush();
        BOOST_TEST(each->unsent() > 0U);
    }
    links.front()->close();
    links.erase(links.begin());
    run_until(io, [&] {
        std::array<char, 2000> text{};
        while (::recv(ends[1], text.data(), text.size(), MSG_DONTWAIT) > 0) {
        }
        return events[1]->has('r') && events[2]->has('r');
    });
    for (const auto& each : links) {
        BOOST_TEST(each->unsent() == 0U);
        each->close();
    }
    ::close(ends[1]);
}

/// Marks what it has sealed with a number, and gives up lines that begin with '-'.
class numbering_codec final : public cles::transport::datagram_codec {
  public:
    void start(carrier& owner) override { owner_ = &owner; }
    void stop() override { owner_ = nullptr; }
    void receive(const endpoint& from, std::string_view datagram) override {
        owner_->on_opened({.at = from, .member = 1}, 7, datagram.substr(datagram.find(':') + 1));
    }
    void send(const cles::transport::datagram_origin& to, std::string_view line) override {
        if (!line.starts_with('-')) {
            owner_->transmit(to.at, std::to_string(++sealed_) + ":" + std::string{line});
        }
    }
    void contact(const cles::transport::datagram_origin&) override {}
    void check_peer(const cles::transport::datagram_origin&, cles::time_point) override {}
    void release(const cles::transport::datagram_origin&) override {}
    [[nodiscard]] std::string name_of(std::uint32_t member) const override { return std::to_string(member); }

  private:
    carrier* owner_ = nullptr;
    int sealed_ = 0;
};

// Nothing is sealed and then sent twice, or lost.
BOOST_AUTO_TEST_CASE(what_is_sealed_waits_for_a_writable_socket_too) {
    asio::io_context io;
    std::array<int, 2> ends{};
    BOOST_REQUIRE(::socketpair(AF_UNIX, SOCK_DGRAM, 0, ends.data()) == 0);
    const auto port = std::make_shared<cles::transport::udp_port>(udp::socket{io, udp::v4(), ends[0]},
                                                                  std::make_unique<numbering_codec>());
    const auto link = port->connect_link({asio::ip::address_v4::loopback(), 1},
                                         {.transport = "udp", .address = {}, .name = "1", .uid = {}}, 1);
    const auto events = std::make_shared<link_recorder>();
    link->start(events);
    lines sent;
    for (int i = 0; i < 1000; ++i) {
        sent.push_back(std::to_string(i));
        link->output().append(sent.back()).append("\n");
        if (i % 7 == 0) {
            link->output().append("-waits elsewhere\n");
        }
        if (i % 50 == 49) {
            link->flush();
            BOOST_TEST(link->output().empty());
        }
    }
    BOOST_TEST(link->unsent() > 0U);
    lines arrived;
    int number = 0;
    run_until(io, [&] {
        std::array<char, 2000> text{};
        const auto count = ::recv(ends[1], text.data(), text.size(), MSG_DONTWAIT);
        if (count > 0) {
            const std::string datagram{text.data(), static_cast<std::size_t>(count)};
            const auto colon = datagram.find(':');
            BOOST_TEST(std::stoi(datagram) > number); // a counter is never used again
            number = std::stoi(datagram);
            arrived.push_back(datagram.substr(colon + 1));
        }
        return arrived.size() == sent.size();
    });
    BOOST_TEST((arrived == sent));
    run_until(io, [&] { return link->unsent() == 0; });
    link->close();
    ::close(ends[1]);
}

BOOST_AUTO_TEST_SUITE_END()
