// SPDX-License-Identifier: BSL-1.0
// A host with several addresses: they are tried in order.

#include "support/run_until.hpp"
#include "transport/stream_endpoint.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/test/unit_test.hpp>

#include <cstring>
#include <memory>
#include <string>
#include <vector>

namespace stream_dialler {
namespace {

using boost::asio::ip::tcp;
using cles::test::run_until;
using dialler = cles::transport::stream_dialler;
using cles::transport::stream_socket;

const auto loopback = boost::asio::ip::address_v4::loopback();

struct fixture {
    // Dials, and returns the result: "link to 4711", or the message of the failure.
    std::string dial(std::vector<tcp::endpoint> where) {
        std::string ended;
        const auto identify = [](stream_socket& s) {
            const auto any = s.remote_endpoint();
            tcp::endpoint peer;
            std::memcpy(peer.data(), any.data(), any.size());
            return cles::identity{.transport = "tcp", .address = std::to_string(peer.port())};
        };
        const auto d = std::make_shared<dialler>(io.get_executor(), cles::limits{}, identify,
                                                 [&](boost::system::error_code code, const cles::link_ptr& made) {
                                                     ended = code ? code.message() : "link to " + made->peer().address;
                                                 });
        d->start(std::vector<cles::transport::stream_address>(where.begin(), where.end()));
        run_until(io, [&] { return !ended.empty(); });
        return ended;
    }
    tcp::endpoint nobody() {
        tcp::acceptor gone{io, {loopback, 0}};
        return gone.local_endpoint();
    }

    boost::asio::io_context io;
    tcp::acceptor listener{io, {loopback, 0}};
    std::string success = "link to " + std::to_string(listener.local_endpoint().port());
};

} // namespace
} // namespace stream_dialler

BOOST_FIXTURE_TEST_SUITE(stream_dialler, fixture)

BOOST_AUTO_TEST_CASE(uses_the_first_that_accepts) {
    tcp::acceptor other{io, {loopback, 0}};
    BOOST_TEST(dial({listener.local_endpoint(), other.local_endpoint()}) == success);
}

BOOST_AUTO_TEST_CASE(tries_the_next_where_there_is_no_listener) {
    BOOST_TEST(dial({nobody(), nobody(), listener.local_endpoint()}) == success);
}

BOOST_AUTO_TEST_CASE(fails_with_the_last_failure_if_none_accepts) {
    BOOST_TEST(dial({nobody(), nobody()}) == "Connection refused");
}

BOOST_AUTO_TEST_CASE(no_event_follows_cancellation) {
    bool called = false;
    const auto d = std::make_shared<dialler>(
        io.get_executor(), cles::limits{}, [](stream_socket&) { return cles::identity{}; },
        [&](boost::system::error_code, const cles::link_ptr&) { called = true; });
    d->start({nobody(), listener.local_endpoint()});
    d->give_up();
    cles::test::run_ready(io);
    BOOST_TEST(!called);
}

BOOST_AUTO_TEST_SUITE_END()
