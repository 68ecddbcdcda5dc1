// SPDX-License-Identifier: BSL-1.0
// What `cles::errc` equals among the conditions of the standard and the codes of Asio.

#include <cles/asio_error.hpp>

#include <boost/asio/error.hpp>
#include <boost/system/error_code.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <system_error>
#include <vector>

namespace error_conditions {
namespace {

using cles::errc;
namespace conditions = boost::system::errc;
namespace asio_error = boost::asio::error;

struct row {
    errc code;
    std::vector<conditions::errc_t> equals{};
};
const row rows[] = {
    {errc::bad_request, {conditions::invalid_argument}},
    {errc::denied, {conditions::permission_denied}},
    {errc::no_target, {conditions::host_unreachable}},
    {errc::no_task, {conditions::operation_not_supported}},
    {errc::too_large, {conditions::message_size}},
    {errc::cancelled, {conditions::operation_canceled}},
    {errc::failed},
    {errc::unavailable, {conditions::connection_reset, conditions::connection_aborted}},
    {errc::busy, {conditions::resource_unavailable_try_again, conditions::device_or_resource_busy}},
    {errc::deadline, {conditions::timed_out}},
    {errc::would_deadlock, {conditions::resource_deadlock_would_occur}},
    {errc::invalid_url, {conditions::invalid_argument}},
    {errc::unknown_scheme, {conditions::protocol_not_supported}},
    {errc::insecure_listen, {conditions::operation_not_permitted}},
    {errc::invalid_name, {conditions::invalid_argument}},
    {errc::already_registered, {conditions::file_exists}},
    {errc::conversion, {conditions::bad_message}},
    {errc::stopped, {conditions::operation_canceled}},
};
const conditions::errc_t all_conditions[] = {conditions::invalid_argument,
                                             conditions::permission_denied,
                                             conditions::host_unreachable,
                                             conditions::operation_not_supported,
                                             conditions::message_size,
                                             conditions::operation_canceled,
                                             conditions::connection_reset,
                                             conditions::connection_aborted,
                                             conditions::resource_unavailable_try_again,
                                             conditions::device_or_resource_busy,
                                             conditions::timed_out,
                                             conditions::resource_deadlock_would_occur,
                                             conditions::protocol_not_supported,
                                             conditions::operation_not_permitted,
                                             conditions::file_exists,
                                             conditions::bad_message,
                                             conditions::io_error};

} // namespace
} // namespace error_conditions

BOOST_AUTO_TEST_SUITE(error_conditions)

BOOST_AUTO_TEST_CASE(each_code_equals_the_matching_conditions_only) {
    for (const auto& r : rows) {
        const auto code = make_error_code(r.code);
        for (const auto condition : all_conditions) {
            const bool wanted = std::find(r.equals.begin(), r.equals.end(), condition) != r.equals.end();
            BOOST_TEST((code == make_error_condition(condition)) == wanted,
                       code.message() << " and " << make_error_condition(condition).message());
            BOOST_TEST((code == condition) == wanted);
            // The same with the standard's names and classes.
            BOOST_TEST((code == static_cast<std::errc>(condition)) == wanted);
            BOOST_TEST((static_cast<std::error_code>(code) == static_cast<std::errc>(condition)) == wanted);
        }
    }
}

BOOST_AUTO_TEST_CASE(a_code_equals_its_own_condition) {
    for (const auto& r : rows) {
        const auto code = make_error_code(r.code);
        BOOST_TEST((code == code.default_error_condition()));
        BOOST_TEST((code != boost::system::error_condition{}));
    }
    BOOST_TEST((make_error_code(errc::failed).default_error_condition().category() == cles::error_category()));
}

BOOST_AUTO_TEST_CASE(codes_of_asio_compare_as_expected) {
    const boost::system::error_code cancelled = errc::cancelled;
    BOOST_TEST((cancelled == asio_error::operation_aborted));
    BOOST_TEST((asio_error::operation_aborted == cancelled));
    BOOST_TEST(!(cancelled != asio_error::operation_aborted));
    BOOST_TEST(!(asio_error::operation_aborted != cancelled));
    BOOST_TEST((errc::cancelled == asio_error::operation_aborted));
    BOOST_TEST((asio_error::operation_aborted == errc::cancelled));
    BOOST_TEST((cancelled == std::errc::operation_canceled));
    BOOST_TEST((errc::cancelled == std::errc::operation_canceled));
    BOOST_TEST((std::errc::timed_out == errc::deadline));
    BOOST_TEST((errc::cancelled == conditions::operation_canceled));
    BOOST_TEST((make_error_code(errc::stopped) == asio_error::operation_aborted));
    BOOST_TEST((make_error_code(errc::deadline) == asio_error::timed_out));
    BOOST_TEST((make_error_code(errc::busy) == asio_error::try_again));
    BOOST_TEST((make_error_code(errc::unavailable) == asio_error::connection_reset));
    BOOST_TEST((make_error_code(errc::denied) == asio_error::access_denied));
    BOOST_TEST((make_error_code(errc::failed) != asio_error::operation_aborted));
    BOOST_TEST((make_error_code(errc::deadline) != asio_error::operation_aborted));
}

BOOST_AUTO_TEST_CASE(other_codes_compare_with_those_of_asio_as_before) {
    const auto aborted = make_error_code(asio_error::operation_aborted);
    BOOST_TEST((aborted == asio_error::operation_aborted));
    BOOST_TEST((aborted != asio_error::timed_out));
    BOOST_TEST((aborted != errc::cancelled)); // a code of another category
    const auto generic = conditions::make_error_code(conditions::operation_canceled);
    BOOST_TEST((generic != asio_error::operation_aborted));
}

BOOST_AUTO_TEST_SUITE_END()
