// SPDX-License-Identifier: BSL-1.0
// Nodes of one process that have keys, and so transports, of their own.

#include "asio/asio_environment.hpp"
#include "node/local_node.hpp"
#include "security/fleet/fleet.hpp"
#include "security/fleet_fixture.hpp"
#include "support/recorded_reply.hpp"
#include "support/run_until.hpp"
#include "tls/tls_transport.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace own_transport {
namespace {

using namespace cles::security;
using namespace cles::security::test;
using cles::test::outcome;
using cles::test::run_until;

struct fixture {
    // A node that listens by `tls`.
    struct running_node {
        std::shared_ptr<cles::core::local_node> node;
        std::string url;
        std::vector<std::string> requesters{}; ///< the names that its links have proved
        ~running_node() { node->stop(); }
    };

    std::unique_ptr<running_node> start(const std::string& name) {
        auto environment = std::make_shared<cles::asio_port::asio_environment>(io.get_executor());
        environment->add_transport(
            "tls", cles::tls::make_tls_transport(
                       {.fleet = std::make_shared<fleet>(name, key_of(name), authority.share()), .epoch = "5f3a09c1"}));
        auto made = std::make_unique<running_node>();
        cles::core::local_node_options options{.node = {.name = name}};
        options.node.authorise = [to = made.get()](const cles::access& asked) {
            to->requesters.push_back(asked.peer.name);
            return true;
        };
        made->node = std::make_shared<cles::core::local_node>(std::move(environment), std::move(options));
        made->node->start({});
        made->url = made->node->listen("tls://127.0.0.1:0");
        return made;
    }
    outcome pull(running_node& by, std::string_view command, const cles::call_options& options = {}) {
        auto asked = cles::test::record();
        by.node->send_command(command, options, std::move(asked.operation));
        run_until(io, [&] { return asked.result->ended; });
        return *asked.result;
    }

    boost::asio::io_context io;
    fleet_authority authority = authority_with({"car1", "car2", "car3"});
    std::unique_ptr<running_node> car1 = start("car1");
    std::unique_ptr<running_node> car2 = start("car2");
    std::unique_ptr<running_node> car3 = start("car3");
};

} // namespace
} // namespace own_transport

BOOST_FIXTURE_TEST_SUITE(own_transport, fixture)

BOOST_AUTO_TEST_CASE(each_node_has_its_own_key) {
    const auto options = cles::call_options{}.at(car2->url);
    BOOST_TEST(contains(pull(*car1, "PULL self:cles", options).text, R"("node":"car2")"));
    BOOST_TEST(contains(pull(*car3, "PULL self:cles", options).text, R"("node":"car2")"));
    BOOST_TEST((car2->requesters == std::vector<std::string>{"car1", "car3"}));
}

BOOST_AUTO_TEST_CASE(it_is_of_no_other_node) {
    BOOST_TEST(cles::find_transport("tls") == nullptr);
    cles::asio_port::asio_environment other{io.get_executor()};
    BOOST_TEST(!other.has_transport("tls"));
    BOOST_TEST(other.has_transport("tcp"));
    BOOST_TEST(car1->node->environment().has_transport("tls"));
    BOOST_TEST(car1->node->environment().has_transport("tcp"));
    BOOST_TEST(car1->node->environment().is_exposed(cles::parse_url("tls://0.0.0.0:1")));
    BOOST_TEST(!car1->node->environment().is_exposed(cles::parse_url("tls://127.0.0.1:1")));
}

BOOST_AUTO_TEST_CASE(an_address_that_is_configured_for_a_name_is_of_no_other_node) {
    car1->node->peer_channels().set_peer("car2", car2->url);
    BOOST_TEST(contains(pull(*car1, "PULL car2:cles").text, R"("node":"car2")"));
    car1->node->peer_channels().set_peer("car2", car3->url);
    const auto wrong = pull(*car1, "PULL car2:cles");
    BOOST_TEST(wrong.code == boost::system::errc::permission_denied);
    BOOST_TEST(contains(wrong.text, "another member answers there"), wrong.text);
    BOOST_TEST(car3->requesters.empty());
    // The address alone is anybody's, also when it has been tried for a name.
    BOOST_TEST(contains(pull(*car1, "PULL self:cles", cles::call_options{}.at(car3->url)).text, R"("node":"car3")"));
}

BOOST_AUTO_TEST_SUITE_END()
