// SPDX-License-Identifier: BSL-1.0
#include "daemon/service_manager.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/local/datagram_protocol.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <filesystem>
#include <string>

#include <unistd.h>

using boost::asio::local::datagram_protocol;
using cles::runtime::notifier;

namespace notify {
namespace {

// A service manager: the socket, and what came to it.
struct manager {
    explicit manager(const std::string& name) : socket(io, datagram_protocol::endpoint{name}) {}

    std::string hear() {
        std::array<char, 256> buffer{};
        socket.non_blocking(true); // what was told is there already
        boost::system::error_code code;
        const auto size = socket.receive(boost::asio::buffer(buffer), 0, code);
        return code ? code.message() : std::string{buffer.data(), size};
    }

    boost::asio::io_context io;
    datagram_protocol::socket socket;
};

std::string fresh_name() {
    static int count = 0;
    return "cles-notify-" + std::to_string(::getpid()) + "-" + std::to_string(count++);
}

} // namespace
} // namespace notify

BOOST_AUTO_TEST_SUITE(notify)

BOOST_AUTO_TEST_CASE(one_datagram_to_a_path) {
    const auto path = (std::filesystem::temp_directory_path() / fresh_name()).string();
    manager m{path};
    BOOST_TEST(notifier{path}.ready());
    BOOST_TEST(m.hear() == "READY=1");
    BOOST_TEST(m.hear() != "READY=1");
    BOOST_TEST(notifier{path}.stopping());
    BOOST_TEST(m.hear() == "STOPPING=1");
    std::filesystem::remove(path);
}

BOOST_AUTO_TEST_CASE(one_datagram_to_an_abstract_socket) {
    const auto name = fresh_name();
    manager m{std::string{'\0'} + name};
    BOOST_TEST(notifier{"@" + name}.ready());
    BOOST_TEST(m.hear() == "READY=1");
}

BOOST_AUTO_TEST_CASE(a_reload_says_when_it_began) {
    const auto name = fresh_name();
    manager m{std::string{'\0'} + name};
    BOOST_TEST(notifier{"@" + name}.reloading(std::chrono::steady_clock::time_point{std::chrono::milliseconds{5}}));
    BOOST_TEST(m.hear() == "RELOADING=1\nMONOTONIC_USEC=5000");
}

BOOST_AUTO_TEST_CASE(nobody_to_tell_is_no_failure) { BOOST_TEST(notifier{""}.ready()); }

BOOST_AUTO_TEST_CASE(who_cannot_be_told_is_one) {
    BOOST_TEST(!notifier{"@" + fresh_name()}.ready());
    BOOST_TEST(!notifier{"/nowhere/at/all"}.ready());
    BOOST_TEST(!notifier{"relative"}.ready());
    BOOST_TEST(!notifier{"/" + std::string(200, 'x')}.ready());
}

BOOST_AUTO_TEST_SUITE_END()
