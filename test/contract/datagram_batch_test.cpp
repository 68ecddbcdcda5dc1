// SPDX-License-Identifier: BSL-1.0
#include "transport/datagram_batch.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <string>
#include <vector>

namespace {

namespace asio = boost::asio;
using asio::ip::udp;

struct fixture {
    void send(udp::socket& from, const std::string& text) { from.send_to(asio::buffer(text), here.local_endpoint()); }
    /// All that is there, by as many fetches as it takes.
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
    cles::transport::datagram_batch batch;
    std::vector<udp::endpoint> senders;
    int fetches = 0;
};

} // namespace

BOOST_FIXTURE_TEST_SUITE(datagram_batch, fixture)

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
    BOOST_TEST(fetches == 1); // fewer than there is room for: no need to look again
    BOOST_TEST((senders == std::vector{one.local_endpoint(), two.local_endpoint(), one.local_endpoint()}));
}

BOOST_AUTO_TEST_CASE(more_than_fit_come_with_the_next_fetch) {
    std::vector<std::string> expected;
    for (std::size_t i = 0; i < 2 * cles::transport::datagram_batch::most + 1; ++i) {
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
