// SPDX-License-Identifier: BSL-1.0
// Receiving from and sending to a multicast group, over loopback, with a separate port for this test.
#include "support/group_address.hpp"
#include "support/run_until.hpp"
#include "transport/group_port.hpp"
#include "transport/ip_interface.hpp"
#include "transport/udp.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/ip/multicast.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/strand.hpp>
#include <boost/system/system_error.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <cerrno>
#include <cstring>
#include <deque>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <netinet/in.h>
#include <sys/socket.h>

BOOST_AUTO_TEST_SUITE(group_port)

using namespace cles::test;
namespace asio = boost::asio;
using asio::ip::udp;

namespace {

struct member final : cles::core::group_listener {
    member(asio::io_context& io, const cles::multicast_options& where)
        : port(std::make_shared<cles::transport::group_port>(io.get_executor(),
                                                             cles::transport::find_interface(where.interface), where)) {
        port->start(*this);
    }
    ~member() { port->close(); }

    void on_datagram(const cles::core::group_datagram& datagram) override {
        heard.emplace_back(datagram.text);
        sources.push_back(datagram.from);
        said.push_back(datagram.request != nullptr);
        if (during) {
            during();
        }
        if (throw_at_next) {
            throw_at_next = false;
            throw std::runtime_error("a handler's");
        }
        if (close_at_next) {
            port->close();
        }
    }
    void on_writable() override {}

    std::shared_ptr<cles::transport::group_port> port;
    std::vector<std::string> heard;
    std::vector<cles::core::group_source> sources;
    std::deque<bool> said;
    std::function<void()> during{};
    bool close_at_next = false;
    bool throw_at_next = false;
};

struct fixture {
    asio::io_context io;
    cles::multicast_options where = fresh_group();
};

} // namespace

BOOST_FIXTURE_TEST_CASE(every_member_receives_what_one_sends_with_its_source, fixture) {
    member one{io, where};
    member two{io, where};
    BOOST_TEST(one.port->send("BIND all:x\n").bytes == 11U);
    run_until(io, [&] { return one.heard.size() == 1 && two.heard.size() == 1; });
    BOOST_TEST(two.heard[0] == "BIND all:x\n");
    BOOST_TEST((two.sources[0] == one.port->source()));
    BOOST_TEST((one.port->source() != two.port->source()));
    BOOST_TEST(one.port->source().is_loopback());
    BOOST_TEST(two.said[0]);
    one.port->send("garbage\n");
    run_until(io, [&] { return two.heard.size() == 2; });
    BOOST_TEST(!two.said[1]);
}

// Each receives it in a separate function.
BOOST_FIXTURE_TEST_CASE(each_member_completes_its_reaction_before_the_next_receives, fixture) {
    member one{io, where};
    member two{io, where};
    asio::io_context elsewhere;
    member sender{elsewhere, where};
    int done_first = 0;
    one.during = [&] { asio::post(io, [&] { done_first += two.heard.size() < one.heard.size() ? 1 : 0; }); };
    for (const auto* line : {"1\n", "2\n", "3\n"}) {
        sender.port->send(line);
        const auto count = one.heard.size() + 1;
        run_until(io, [&] { return two.heard.size() == count; });
        BOOST_TEST(one.heard.size() == count);
    }
    BOOST_TEST(done_first == 3);
}

BOOST_FIXTURE_TEST_CASE(a_member_alone_on_its_executor_does_not_receive_itself, fixture) {
    member one{io, where};
    asio::io_context elsewhere;
    member two{elsewhere, where};
    one.port->send("1\n");
    two.port->send("2\n");
    run_until(elsewhere, [&] { return two.heard.size() == 1; });
    run_until(io, [&] { return one.heard.size() == 1; });
    run_ready(elsewhere);
    BOOST_TEST(one.heard[0] == "2\n");
    BOOST_TEST(two.heard.size() == 1U);
    { // two of them share what they receive, and each receives what the other sends
        member three{io, where};
        one.port->send("3\n");
        run_until(io, [&] { return three.heard.size() == 1; });
    }
    one.heard.clear();
    one.port->send("4\n");
    two.port->send("5\n");
    run_until(io, [&] { return !one.heard.empty(); });
    BOOST_TEST(one.heard[0] == "5\n");
}

BOOST_FIXTURE_TEST_CASE(the_shared_port_serves_the_group_alone, fixture) {
    member one{io, where};
    member two{io, where};
    udp::socket plain{io, udp::v4()};
    plain.send_to(asio::buffer("to the address", 14), {asio::ip::address_v4::loopback(), where.port});
    auto other_group = where;
    other_group.group = "239.255.25.38";
    member stranger{io, other_group};
    member neighbour{io, other_group};
    stranger.port->send("to another group\n");
    two.port->send("to the group\n");
    run_until(io, [&] { return !one.heard.empty() && !neighbour.heard.empty(); });
    run_ready(io);
    BOOST_TEST(one.heard == std::vector<std::string>{"to the group\n"}, boost::test_tools::per_element());
}

BOOST_FIXTURE_TEST_CASE(datagrams_keep_their_order_and_their_bounds, fixture) {
    member one{io, where};
    member two{io, where};
    for (int i = 0; i < 300; ++i) { // more than one turn delivers
        one.port->send(std::to_string(i) + "\n");
    }
    run_until(io, [&] { return two.heard.size() == 300; });
    for (std::size_t i = 0; i < 300; ++i) {
        BOOST_TEST(two.heard[i] == std::to_string(i) + "\n");
    }
}

BOOST_FIXTURE_TEST_CASE(lines_sent_together_are_a_datagram_each, fixture) {
    member one{io, where};
    member two{io, where};
    std::string lines;
    for (int i = 0; i < 100; ++i) { // more than one system call sends
        lines += std::to_string(i) + "\n";
    }
    BOOST_TEST(one.port->send(lines).bytes == lines.size());
    run_until(io, [&] { return two.heard.size() == 100; });
    for (std::size_t i = 0; i < 100; ++i) {
        BOOST_TEST(two.heard[i] == std::to_string(i) + "\n");
    }
}

BOOST_FIXTURE_TEST_CASE(a_line_that_cannot_be_sent_is_lost_alone, fixture) {
    member one{io, where};
    member two{io, where};
    const std::string lines = "1\n" + std::string(70'000, 'x') + "\n2\n"; // exceeds the maximum of UDP
    const auto done = one.port->send(lines);
    BOOST_TEST(done.bytes == lines.size());
    BOOST_TEST(done.failed == 1U);
    BOOST_TEST(done.why.value() == EMSGSIZE);
    run_until(io, [&] { return two.heard.size() == 2; });
    BOOST_TEST(two.heard == (std::vector<std::string>{"1\n", "2\n"}), boost::test_tools::per_element());
}

BOOST_FIXTURE_TEST_CASE(a_member_that_closes_while_it_receives_receives_no_more, fixture) {
    member one{io, where};
    member two{io, where};
    two.close_at_next = true;
    one.port->send("1\n");
    one.port->send("2\n");
    run_until(io, [&] { return one.heard.size() == 2; });
    run_ready(io);
    BOOST_TEST(two.heard.size() == 1U);
    BOOST_TEST(two.port->send("into the void\n").bytes == 14U); // treated as lost in the network
}

BOOST_FIXTURE_TEST_CASE(what_one_member_throws_keeps_nothing_from_the_others, fixture) {
    member one{io, where};
    member two{io, where};
    one.throw_at_next = true;
    two.port->send("1\n");
    two.port->send("2\n");
    int thrown = 0;
    asio::io_context idle;
    run_until(idle, [&] {
        try {
            io.restart();
            io.poll();
        } catch (const std::runtime_error&) {
            ++thrown;
        }
        return one.heard.size() == 2 && two.heard.size() == 2;
    });
    BOOST_TEST(thrown == 1);
    BOOST_TEST(one.heard == (std::vector<std::string>{"1\n", "2\n"}), boost::test_tools::per_element());
    BOOST_TEST(two.heard == one.heard, boost::test_tools::per_element());
}

BOOST_FIXTURE_TEST_CASE(the_others_still_receive_when_one_leaves_and_it_does_again_after_rejoining, fixture) {
    member one{io, where};
    { const member passing{io, where}; }
    member two{io, where};
    one.port->send("1\n");
    run_until(io, [&] { return one.heard.size() == 1 && two.heard.size() == 1; });
    one.port->close();
    two.port->close();
    member three{io, where};
    member four{io, where};
    three.port->send("2\n");
    run_until(io, [&] { return four.heard.size() == 1; });
    BOOST_TEST(one.heard.size() == 1U);
}

BOOST_FIXTURE_TEST_CASE(members_of_one_executor_share_a_socket_and_those_of_others_do_not, fixture) {
    using cles::transport::receiver_of;
    const auto by = cles::transport::find_interface("lo");
    const udp::endpoint group{asio::ip::make_address_v4(where.group), where.port};
    const udp::endpoint other_group{asio::ip::make_address_v4("239.255.25.38"), where.port};
    asio::io_context elsewhere;
    const auto receiver = receiver_of(io.get_executor(), by, group);
    BOOST_TEST((receiver_of(io.get_executor(), by, group) == receiver));
    BOOST_TEST((receiver_of(io.get_executor(), by, other_group) != receiver));
    BOOST_TEST((receiver_of(elsewhere.get_executor(), by, group) != receiver));
    BOOST_TEST((receiver_of(asio::make_strand(io), by, group) != receiver));
}

// A listener on all addresses has the port of the group, as the default of nodes with security does.
BOOST_FIXTURE_TEST_CASE(a_listener_at_the_port_of_the_group_leaves_the_group_to_others, fixture) {
    const cles::url all{.scheme = "udp", .host = "0.0.0.0", .port = where.port};
    asio::io_context elsewhere;
    const auto refused = [&] {
        try {
            cles::transport::listen_udp(elsewhere.get_executor(), all)->close();
            return boost::system::error_code{};
        } catch (const boost::system::system_error& e) {
            return e.code();
        }
    };
    const auto listener = cles::transport::listen_udp(io.get_executor(), all);
    int links = 0;
    listener->start([&](const cles::link_ptr&) { ++links; });
    {
        member one{io, where};
        member two{elsewhere, where};
        one.port->send("1\n");
        run_until(elsewhere, [&] { return two.heard.size() == 1; });
        udp::socket client{io, udp::v4()};
        client.send_to(asio::buffer("PULL self:x", 11), {asio::ip::address_v4::loopback(), where.port});
        run_until(io, [&] { return links != 0; });
        io.poll();
        BOOST_TEST(links == 1); // of the client: the group's datagrams are not for it
        BOOST_TEST(one.heard.empty());
        BOOST_TEST(refused() == boost::system::errc::address_in_use);
    }
    BOOST_TEST(refused() == boost::system::errc::address_in_use);
    listener->close();
    member one{io, where};
    BOOST_TEST(!refused());
}

BOOST_FIXTURE_TEST_CASE(a_listener_at_a_free_port_leaves_the_groups_of_that_port_to_others, fixture) {
    const auto listener =
        cles::transport::listen_udp(io.get_executor(), {.scheme = "udp", .host = "0.0.0.0", .port = 0});
    where.port = listener->local().port;
    member one{io, where};
    listener->close();
}

BOOST_FIXTURE_TEST_CASE(datagrams_go_out_with_a_TTL_of_1, fixture) {
    udp::socket sniffer{io, udp::v4()};
    sniffer.set_option(asio::socket_base::reuse_address{true});
    sniffer.bind({asio::ip::make_address_v4(where.group), where.port});
    const auto by = cles::transport::find_interface("lo");
    sniffer.set_option(
        asio::ip::multicast::join_group{asio::ip::make_address_v4(where.group), asio::ip::address_v4{by.address}});
    const int on = 1;
    BOOST_REQUIRE(::setsockopt(sniffer.native_handle(), IPPROTO_IP, IP_RECVTTL, &on, sizeof on) == 0);
    sniffer.non_blocking(true);
    member one{io, where};
    one.port->send("x\n");

    std::array<char, 64> data{};
    alignas(cmsghdr) std::array<char, 64> control{};
    iovec piece{.iov_base = data.data(), .iov_len = data.size()};
    msghdr message{};
    message.msg_iov = &piece;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    run_until(io, [&] { return ::recvmsg(sniffer.native_handle(), &message, 0) == 2; });
    const auto* first = CMSG_FIRSTHDR(&message);
    BOOST_REQUIRE(first != nullptr);
    BOOST_TEST(first->cmsg_type == IP_TTL);
    int ttl = 0;
    std::memcpy(&ttl, CMSG_DATA(first), sizeof ttl);
    BOOST_TEST(ttl == 1);
}

BOOST_FIXTURE_TEST_CASE(an_invalid_interface_is_refused, fixture) {
    const auto code_of = [](const std::string& name) {
        try {
            cles::transport::find_interface(name);
        } catch (const boost::system::system_error& e) {
            return e.code().value();
        }
        return 0;
    };
    BOOST_TEST(code_of("nowhere0") == ENODEV);
    BOOST_TEST(code_of("a-name-longer-than-any-interface") == ENODEV);
    BOOST_TEST(code_of("") == ENODEV);
    BOOST_TEST(cles::transport::find_interface("lo").loopback);
}

BOOST_AUTO_TEST_SUITE_END()
