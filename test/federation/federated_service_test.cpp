// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/federation.hpp>
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

BOOST_AUTO_TEST_SUITE(federated_service)

BOOST_AUTO_TEST_CASE(it_has_to_be_permitted) {
    boost::asio::io_context io{1};
    cles::service_options options{.name = "hub"};
    options.federation = cles::federation({.servers = {"nats://127.0.0.1:1"}, .pool = "south"});
    BOOST_CHECK_EXCEPTION(cles::service(io, options), cles::error,
                          [](const cles::error& e) { return e.code() == cles::errc::insecure_listen; });
}

BOOST_AUTO_TEST_CASE(a_bridge_waits_for_requests_like_a_node_that_listens) {
    boost::asio::io_context io{1};
    cles::service_options options{.name = "hub"};
    options.insecure = true;
    options.federation = cles::federation({.servers = {"nats://127.0.0.1:1"}, .pool = "south"}); // nobody is there
    cles::service hub{io, options};
    io.poll();
    BOOST_TEST(!io.stopped());
    hub.stop();
    io.run(); // ends
    BOOST_TEST(io.stopped());
}

BOOST_AUTO_TEST_SUITE_END()
