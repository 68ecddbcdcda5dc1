// SPDX-License-Identifier: BSL-1.0
#include "security/child_process.hpp"
#include "security/secured_services.hpp"

#include <boost/test/unit_test.hpp>

#include <cstdlib>
#include <optional>

namespace static_service {
namespace {

using namespace cles::security::test;

// Made before anything that the libraries keep in static objects, and so destroyed after it.
std::optional<boost::asio::io_context> context_of_process;
std::optional<cles::service> server_of_process;
std::optional<cles::service> client_of_process;

} // namespace

BOOST_AUTO_TEST_SUITE(static_service)

BOOST_AUTO_TEST_CASE(secured_services_are_destroyed_at_exit) {
    for (const std::string scheme : {"tls", "udp"}) {
        const secured_fleet fleet{"car1", "car2"};
        BOOST_TEST(in_child([&] {
                       auto& io = context_of_process.emplace();
                       auto served = fleet.options("car1");
                       served.listen = {scheme + "://127.0.0.1:0"};
                       server_of_process.emplace(io, served).on_pull("speed", [] { return 7; });
                       client_of_process.emplace(io, fleet.knowing("car2", *server_of_process));
                       if (ask(io, *client_of_process, "PULL car1:speed") == R"({"value":7})") {
                           std::exit(0); // NOLINT(concurrency-mt-unsafe)
                       }
                       return false;
                   }),
                   scheme);
    }
}

BOOST_AUTO_TEST_SUITE_END()
} // namespace static_service
