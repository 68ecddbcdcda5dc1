// SPDX-License-Identifier: BSL-1.0
#include "gateway/access/origin.hpp"

#include <boost/test/unit_test.hpp>

#include <string>
#include <utility>
#include <vector>

namespace origin {
namespace {

/// A request with this Host and these fields.
gateway::http_request from(std::string host, gateway::header_fields fields = {}) {
    gateway::http_request made;
    made.fields = std::move(fields);
    made.fields.emplace_back("host", std::move(host));
    return made;
}

gateway::http_request of_page(std::string host, std::string stated) {
    return origin::from(std::move(host), {{"origin", std::move(stated)}});
}

/// The status with which it is refused; 200 if it is not.
int status_of(const gateway::origin_rules& rules, const gateway::http_request& request, bool is_page = false) {
    const auto why = gateway::origin_refusal(rules, request, is_page);
    return why ? why->status : 200;
}

std::string field(const gateway::header_fields& fields, const std::string& name) {
    gateway::http_request shown;
    shown.fields = fields;
    return std::string{shown.field(name)};
}

} // namespace
} // namespace origin

BOOST_AUTO_TEST_SUITE(origin)

// DNS rebinding: the name of a foreign page leads here, and its requests have that name.
BOOST_AUTO_TEST_CASE(the_host_is_one_of_ours) {
    const gateway::origin_rules rules{.hosts = {"fleet.example"}};
    for (const auto* const host : {"localhost", "localhost:25380", "LocalHost:25380", "127.0.0.1:25380", "10.0.0.7",
                                   "[::1]", "[::1]:25380", "fleet.example", "FLEET.example:443"}) {
        BOOST_TEST(origin::status_of(rules, origin::from(host)) == 200, host);
    }
    for (const auto* const host :
         {"", "evil.example", "evil.example:25380", "fleet.example.evil", "localhost.evil",
          "localhost:", "localhost:1x", "localhost:123456", "localhost:80:80", "127.0.0.1.evil", "[::1", "[::1]evil",
          "[evil]:1", ":80", "a@localhost", "localhost evil"}) {
        BOOST_TEST(origin::status_of(rules, origin::from(host)) == 421, host);
    }
    auto two = origin::from("localhost");
    two.fields.emplace_back("host", "localhost");
    BOOST_TEST(origin::status_of(rules, two) == 421);
}

BOOST_AUTO_TEST_CASE(pages_of_other_origins_are_refused) {
    const gateway::origin_rules rules{};
    BOOST_TEST(origin::status_of(rules, origin::of_page("localhost:25380", "http://localhost:25380")) == 200);
    for (const auto* const stated :
         {"http://evil.example", "null", "", "http://localhost", "http://localhost:25381", "https://localhost:25380",
          "http://127.0.0.1:25380", "http://localhost:25380.evil", "file://localhost:25380", "localhost:25380"}) {
        BOOST_TEST(origin::status_of(rules, origin::of_page("localhost:25380", stated)) == 403, stated);
    }
    auto two = origin::of_page("localhost:25380", "http://localhost:25380");
    two.fields.emplace_back("origin", "http://evil.example");
    BOOST_TEST(origin::status_of(rules, two) == 403);
}

BOOST_AUTO_TEST_CASE(the_scheme_is_that_of_the_gateway_or_its_proxy) {
    const gateway::origin_rules tls{.is_tls = true};
    BOOST_TEST(origin::status_of(tls, origin::of_page("localhost", "https://localhost")) == 200);
    BOOST_TEST(origin::status_of(tls, origin::of_page("localhost", "http://localhost")) == 403);
    const gateway::origin_rules proxy{.is_behind_proxy = true};
    BOOST_TEST(origin::status_of(proxy, origin::of_page("localhost", "https://localhost")) == 200);
    BOOST_TEST(origin::status_of(proxy, origin::of_page("localhost", "http://localhost")) == 200);
}

BOOST_AUTO_TEST_CASE(without_an_origin_the_site_decides) {
    const gateway::origin_rules rules{};
    for (const auto& [site, status] : std::vector<std::pair<std::string, int>>{
             {"same-origin", 200}, {"none", 200}, {"cross-site", 403}, {"same-site", 403}}) {
        const auto request = origin::from("localhost", {{"sec-fetch-site", site}});
        BOOST_TEST(origin::status_of(rules, request) == status, site);
        BOOST_TEST(origin::status_of(rules, request, true) == 200, site); // others may lead to its page
    }
}

BOOST_AUTO_TEST_CASE(other_origins_may_be_allowed) {
    const gateway::origin_rules rules{.origins = {"https://fleet.example"}};
    const auto request = origin::of_page("localhost", "https://fleet.example");
    BOOST_TEST(origin::status_of(rules, request) == 200);
    const auto fields = gateway::cors_fields(rules, request);
    BOOST_TEST(origin::field(fields, "Access-Control-Allow-Origin") == "https://fleet.example");
    BOOST_TEST(origin::field(fields, "Vary") == "Origin");
    BOOST_TEST(origin::status_of(rules, origin::of_page("localhost", "https://fleet.example.evil")) == 403);
    BOOST_TEST(gateway::cors_fields(rules, origin::of_page("localhost", "http://localhost")).empty());
    BOOST_TEST(gateway::cors_fields(rules, origin::from("localhost")).empty());
}

BOOST_AUTO_TEST_CASE(browsers_ask_before_they_send) {
    const gateway::origin_rules rules{.origins = {"https://fleet.example"}};
    const auto allowed = gateway::preflight(rules, origin::of_page("localhost", "https://fleet.example"));
    BOOST_TEST(allowed.status == 204);
    BOOST_TEST(origin::field(allowed.fields, "Access-Control-Allow-Methods") == "GET, POST, DELETE");
    BOOST_TEST(origin::field(allowed.fields, "Access-Control-Allow-Headers").find("authorization") == 0U);
    BOOST_TEST(origin::field(allowed.fields, "Access-Control-Allow-Credentials") == "");
    const auto foreign = gateway::preflight(rules, origin::of_page("localhost", "https://evil.example"));
    BOOST_TEST(foreign.status == 403);
    BOOST_TEST(origin::field(foreign.fields, "Access-Control-Allow-Origin") == "");
}

BOOST_AUTO_TEST_SUITE_END()
