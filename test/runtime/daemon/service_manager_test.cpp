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

namespace service_manager {
namespace {

// The socket of a service manager, and what it has received.
struct fake_manager {
    explicit fake_manager(const std::string& name) : socket(io, datagram_protocol::endpoint{name}) {}

    std::string receive() {
        std::array<char, 256> buffer{};
        socket.non_blocking(true); // the datagram has arrived already
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
} // namespace service_manager

BOOST_AUTO_TEST_SUITE(service_manager)

using notifier = cles::runtime::service_manager;

BOOST_AUTO_TEST_CASE(one_datagram_to_a_path) {
    const auto path = (std::filesystem::temp_directory_path() / fresh_name()).string();
    fake_manager m{path};
    BOOST_TEST(notifier{path}.ready());
    BOOST_TEST(m.receive() == "READY=1");
    BOOST_TEST(m.receive() != "READY=1");
    BOOST_TEST(notifier{path}.stopping());
    BOOST_TEST(m.receive() == "STOPPING=1");
    std::filesystem::remove(path);
}

BOOST_AUTO_TEST_CASE(one_datagram_to_an_abstract_socket) {
    const auto name = fresh_name();
    fake_manager m{std::string{'\0'} + name};
    BOOST_TEST(notifier{"@" + name}.ready());
    BOOST_TEST(m.receive() == "READY=1");
}

BOOST_AUTO_TEST_CASE(a_reload_has_a_timestamp) {
    const auto name = fresh_name();
    fake_manager m{std::string{'\0'} + name};
    BOOST_TEST(notifier{"@" + name}.reloading(std::chrono::steady_clock::time_point{std::chrono::milliseconds{5}}));
    BOOST_TEST(m.receive() == "RELOADING=1\nMONOTONIC_USEC=5000");
}

BOOST_AUTO_TEST_CASE(a_heartbeat_at_half_the_limit) {
    using namespace std::chrono_literals;
    const auto name = fresh_name();
    fake_manager m{std::string{'\0'} + name};
    const notifier watching{"@" + name, 3s};
    BOOST_TEST((watching.heartbeat() == 1500ms));
    BOOST_TEST(watching.alive());
    BOOST_TEST(m.receive() == "WATCHDOG=1");
    BOOST_TEST((notifier{"@" + name}.heartbeat() == 0s));
    BOOST_TEST((notifier{"", 3s}.heartbeat() == 0s)); // nobody would receive it
}

BOOST_AUTO_TEST_CASE(the_limit_is_that_of_this_process) {
    using cles::runtime::watchdog_of;
    using namespace std::chrono_literals;
    BOOST_TEST((watchdog_of("3000000", "17", 17) == 3s));
    BOOST_TEST((watchdog_of("3000000", nullptr, 17) == 3s));
    BOOST_TEST((watchdog_of("3000000", "18", 17) == 0s));
    BOOST_TEST((watchdog_of(nullptr, "17", 17) == 0s));
    for (const auto* malformed : {"", "0", "-1", "3s", " 3", "1e6", "18446744073709551615"}) {
        BOOST_TEST((watchdog_of(malformed, nullptr, 17) == 0s), malformed);
        BOOST_TEST((watchdog_of("3000000", malformed, 17) == 0s), malformed);
    }
    BOOST_TEST((watchdog_of("9223372036854775807", nullptr, 17) == 24h));
}

BOOST_AUTO_TEST_CASE(without_a_service_manager_nothing_fails) { BOOST_TEST(notifier{""}.ready()); }

BOOST_AUTO_TEST_CASE(an_unreachable_service_manager_is_a_failure) {
    BOOST_TEST(!notifier{"@" + fresh_name()}.ready());
    BOOST_TEST(!notifier{"/nowhere/at/all"}.ready());
    BOOST_TEST(!notifier{"relative"}.ready());
    BOOST_TEST(!notifier{"/" + std::string(200, 'x')}.ready());
}

BOOST_AUTO_TEST_SUITE_END()
