// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include <boost/system/error_code.hpp>
#include <boost/test/unit_test.hpp>

#include <set>
#include <string>
#include <string_view>

namespace error {
namespace {

using cles::errc;

struct named {
    errc code;
    std::string_view name;
};
const named on_the_wire[] = {
    {errc::bad_request, "bad_request"}, {errc::denied, "denied"},           {errc::no_target, "no_target"},
    {errc::no_task, "no_task"},         {errc::too_large, "too_large"},     {errc::cancelled, "cancelled"},
    {errc::failed, "failed"},           {errc::unavailable, "unavailable"}, {errc::busy, "busy"},
    {errc::deadline, "deadline"}};
const named in_the_process[] = {{errc::would_deadlock, "would_deadlock"},
                                {errc::invalid_url, "invalid_url"},
                                {errc::unknown_scheme, "unknown_scheme"},
                                {errc::insecure_listen, "insecure_listen"},
                                {errc::invalid_name, "invalid_name"},
                                {errc::already_registered, "already_registered"},
                                {errc::conversion, "conversion"},
                                {errc::stopped, "stopped"},
                                {errc::closed, "closed"}};

} // namespace
} // namespace error

BOOST_AUTO_TEST_SUITE(error)

BOOST_AUTO_TEST_CASE(the_codes_of_the_table_cross_the_wire_by_name) {
    for (const auto& n : on_the_wire) {
        BOOST_TEST(cles::wire_name(n.code) == n.name);
        BOOST_TEST((cles::errc_from_wire(n.name) == n.code), n.name);
    }
}

BOOST_AUTO_TEST_CASE(a_local_code_is_sent_as_failed) {
    for (const auto& n : in_the_process) {
        BOOST_TEST(cles::wire_name(n.code) == "failed", n.name);
        BOOST_TEST((cles::errc_from_wire(n.name) == errc::failed), n.name); // and a peer cannot send one
    }
}

BOOST_AUTO_TEST_CASE(an_unknown_name_counts_as_failed) {
    for (const std::string_view name : {"", "overheated", "BUSY", "busy ", "no_targets"}) {
        BOOST_TEST((cles::errc_from_wire(name) == errc::failed), name);
    }
}

BOOST_AUTO_TEST_CASE(the_category_has_a_message_for_each_code) {
    BOOST_TEST(cles::error_category().name() == std::string_view{"cles"});
    std::set<std::string> messages;
    for (const auto& n : on_the_wire) {
        messages.insert(make_error_code(n.code).message());
    }
    for (const auto& n : in_the_process) {
        messages.insert(make_error_code(n.code).message());
    }
    BOOST_TEST(messages.size() == 19U); // all are different
    BOOST_TEST(!messages.contains(""));
    BOOST_TEST(cles::error_category().message(4711) == "unknown error");
    BOOST_TEST(!messages.contains("unknown error"));
}

BOOST_AUTO_TEST_CASE(a_code_compares_with_its_enumerator_and_is_never_success) {
    const boost::system::error_code code = errc::busy;
    BOOST_TEST((code == errc::busy));
    BOOST_TEST((code != errc::deadline));
    BOOST_TEST(static_cast<bool>(code));
    for (const auto& n : on_the_wire) {
        BOOST_TEST(static_cast<bool>(make_error_code(n.code)), n.name);
    }
}

BOOST_AUTO_TEST_CASE(an_error_has_the_codes_name_and_the_message) {
    const cles::error e{errc::no_task, "car1 has no PULL 'speed'"};
    BOOST_TEST(e.what() == std::string_view{"no_task: car1 has no PULL 'speed'"});
    BOOST_TEST(e.message() == "car1 has no PULL 'speed'");
    BOOST_TEST((e.code() == errc::no_task));
    BOOST_TEST(cles::error(errc::stopped, "").what() == std::string_view{"stopped"});
}

BOOST_AUTO_TEST_CASE(a_system_error_has_its_own_message_or_else_the_systems) {
    const auto refused = boost::system::errc::make_error_code(boost::system::errc::connection_refused);
    const cles::error e{refused, "cannot connect to tcp://10.0.0.2:25370"};
    BOOST_TEST(e.what() == std::string_view{"cannot connect to tcp://10.0.0.2:25370"});
    BOOST_TEST(cles::error(refused, "").what() == refused.message());
    BOOST_TEST((e.code() == refused));
}

BOOST_AUTO_TEST_SUITE_END()
