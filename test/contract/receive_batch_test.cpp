// SPDX-License-Identifier: BSL-1.0
#include "transport/datagram_io.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include <sys/eventfd.h>

namespace receive_batch {
namespace {

namespace asio = boost::asio;
using asio::ip::udp;

struct fixture {
    void send(udp::socket& from, const std::string& text) { from.send_to(asio::buffer(text), here.local_endpoint()); }
    /// Everything that has arrived, in as many fetches as necessary.
    std::vector<std::string> take_all() {
        std::vector<std::string> texts;
        for (bool more = true; more;) {
            more = batch.fetch(here);
            ++fetches;
            while (!batch.empty()) {
                const auto one = batch.take();
                texts.emplace_back(one.text);
                senders.push_back(one.from);
            }
        }
        return texts;
    }

    asio::io_context io;
    udp::socket here{io, {asio::ip::address_v4::loopback(), 0}};
    udp::socket one{io, {asio::ip::address_v4::loopback(), 0}};
    udp::socket two{io, {asio::ip::address_v4::loopback(), 0}};
    cles::transport::receive_batch batch;
    std::vector<udp::endpoint> senders;
    int fetches = 0;
};

} // namespace
} // namespace receive_batch

BOOST_FIXTURE_TEST_SUITE(receive_batch, fixture)

BOOST_AUTO_TEST_CASE(where_nothing_is_nothing_is_fetched) {
    BOOST_TEST(!batch.fetch(here));
    BOOST_TEST(batch.empty());
}

BOOST_AUTO_TEST_CASE(all_come_in_their_order_with_where_they_come_from) {
    send(one, "first");
    send(two, "");
    send(one, "third");
    const std::vector<std::string> expected{"first", "", "third"};
    BOOST_TEST(take_all() == expected, boost::test_tools::per_element());
    BOOST_TEST(fetches == 1); // fewer than the capacity: no further call is necessary
    BOOST_TEST((senders == std::vector{one.local_endpoint(), two.local_endpoint(), one.local_endpoint()}));
}

BOOST_AUTO_TEST_CASE(more_than_fit_come_with_the_next_fetch) {
    std::vector<std::string> expected;
    for (std::size_t i = 0; i < 2 * cles::transport::receive_batch::most + 1; ++i) {
        expected.push_back(std::to_string(i));
        send(one, expected.back());
    }
    BOOST_TEST(take_all() == expected, boost::test_tools::per_element());
    BOOST_TEST(fetches == 3);
}

BOOST_AUTO_TEST_CASE(one_of_the_longest_is_whole_and_a_longer_one_shows_as_such) {
    send(one, std::string(1200, 'x'));
    send(one, std::string(9000, 'y'));
    const auto texts = take_all();
    BOOST_REQUIRE(texts.size() == 2U);
    BOOST_TEST(texts[0].size() == 1200U);
    BOOST_TEST(texts[1].size() == 9000U);
}

BOOST_AUTO_TEST_CASE(a_turn_hands_over_so_many_and_leaves_the_rest_where_it_is) {
    cles::transport::receive_batch::prepare(here);
    one.connect(here.local_endpoint());
    std::string lines;
    constexpr std::size_t sent = 600;
    for (std::size_t i = 0; i < sent; ++i) {
        lines += std::to_string(1000 + i) + "\n";
    }
    cles::transport::send_batch burst{one};
    for (std::string_view rest = lines; !rest.empty();) {
        rest.remove_prefix(burst.send(rest).bytes);
    }
    std::vector<std::string> come;
    const auto keep = [&](const auto& each) { come.emplace_back(each.text); };
    int turns = 0;
    std::size_t before = 0;
    for (; come.size() < sent && turns < 10; ++turns) {
        const bool left = batch.hand_over(here, keep);
        BOOST_TEST(left == !batch.empty());
        BOOST_TEST(come.size() - before <= 256U);
        before = come.size();
    }
    BOOST_TEST(turns == 3);
    BOOST_REQUIRE(come.size() == sent);
    for (std::size_t i = 0; i < sent; ++i) {
        BOOST_TEST(come[i] == std::to_string(1000 + i) + "\n");
    }
}

BOOST_AUTO_TEST_CASE(one_that_ends_in_the_middle_gets_no_more) {
    for (const auto* text : {"1", "2", "3"}) {
        send(one, text);
    }
    int came = 0;
    BOOST_TEST(!batch.hand_over(here, [&](const auto&) {
        ++came;
        here.close();
    }));
    BOOST_TEST(came == 1);
}

BOOST_AUTO_TEST_CASE(what_always_fails_does_not_delay_the_others) {
    udp::socket no_socket{io};
    no_socket.assign(udp::v4(), ::eventfd(0, EFD_NONBLOCK));
    BOOST_TEST(!batch.hand_over(no_socket, [](const auto&) { BOOST_ERROR("nothing came"); }));
    BOOST_TEST(no_socket.is_open());
}

BOOST_AUTO_TEST_CASE(what_the_network_tells_of_is_passed_over) {
    udp::endpoint nobody;
    {
        udp::socket gone{io, {asio::ip::address_v4::loopback(), 0}};
        nobody = gone.local_endpoint();
    }
    one.connect(nobody);
    one.send(asio::buffer("x", 1));
    BOOST_TEST(batch.fetch(one)); // refused: there may be more behind it
    BOOST_TEST(batch.empty());
    BOOST_TEST(!batch.fetch(one));
}

BOOST_AUTO_TEST_SUITE_END()
