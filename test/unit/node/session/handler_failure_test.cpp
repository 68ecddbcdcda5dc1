// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include "node/session/handler_failure.hpp"

#include <boost/system/system_error.hpp>
#include <boost/test/unit_test.hpp>

#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

namespace handler_failure {
namespace {

using cles::errc;

template <class E>
cles::protocol::failure describe(const E& thrown) {
    return cles::core::describe(std::make_exception_ptr(thrown));
}

} // namespace
} // namespace handler_failure

BOOST_AUTO_TEST_SUITE(handler_failure)

BOOST_AUTO_TEST_CASE(a_cles_error_keeps_its_code_and_message) {
    for (const auto code : {errc::bad_request, errc::denied, errc::no_target, errc::no_task, errc::too_large,
                            errc::cancelled, errc::failed, errc::unavailable, errc::busy, errc::deadline}) {
        const auto f = describe(cles::error{code, "the words"});
        BOOST_TEST((f.code == code), cles::wire_name(code));
        BOOST_TEST(f.message == "the words");
    }
}

BOOST_AUTO_TEST_CASE(a_code_that_never_leaves_the_process_becomes_failed) {
    for (const auto code : {errc::would_deadlock, errc::invalid_url, errc::conversion, errc::stopped}) {
        const auto f = describe(cles::error{code, "the words"});
        BOOST_TEST((f.code == errc::failed));
        BOOST_TEST(f.message == "the words");
    }
}

BOOST_AUTO_TEST_CASE(any_other_exception_becomes_failed_with_its_message) {
    BOOST_TEST((describe(std::runtime_error{"the sensor is off"}).code == errc::failed));
    BOOST_TEST(describe(std::runtime_error{"the sensor is off"}).message == "the sensor is off");
    BOOST_TEST(describe(42).message == "the handler failed");
    BOOST_TEST((describe(42).code == errc::failed));
}

BOOST_AUTO_TEST_CASE(a_system_error_has_the_message_of_its_code) {
    const auto ours = boost::system::errc::make_error_code(boost::system::errc::connection_refused);
    BOOST_TEST(describe(boost::system::system_error{ours, "/home/me/car.cpp:12"}).message == ours.message());
    const auto theirs = std::make_error_code(std::errc::connection_refused);
    BOOST_TEST(describe(std::system_error{theirs, "/home/me/car.cpp:12"}).message == theirs.message());
    const std::filesystem::filesystem_error file{"cannot open", "/home/me/secret", theirs};
    BOOST_TEST(describe(file).message.find("secret") == std::string::npos);
}

BOOST_AUTO_TEST_CASE(a_message_never_contains_a_file_path) {
    struct example {
        std::string_view thrown;
        std::string_view told;
    };
    const example examples[] = {
        {"cannot open /etc/passwd", "cannot open ..."},
        {"/home/me/car.cpp:12: assertion", "... assertion"},
        {"file '/var/lib/x' is gone", "file '...' is gone"},
        {"(/a/b)", "(...)"},
        {"in=/a/b, out=/c", "in=..., out=..."},
        {"\"/a b\"", "\"... b\""},
        {"3 m/s and 1/2 of a/b", "3 m/s and 1/2 of a/b"},
        {"a / b", "a / b"},
        {"ends in /", "ends in /"},
        {"", ""},
    };
    for (const auto& e : examples) {
        BOOST_TEST(describe(std::runtime_error{std::string{e.thrown}}).message == e.told);
        BOOST_TEST(describe(cles::error{errc::busy, std::string{e.thrown}}).message == e.told);
    }
}

BOOST_AUTO_TEST_SUITE_END()
