// SPDX-License-Identifier: BSL-1.0
// Incoming links while the process or the system has run out of a resource.

#include "support/data_test_case.hpp"
#include "support/link_pair.hpp"
#include "support/run_until.hpp"
#include "support/scripted_peer.hpp"

#include <boost/asio/steady_timer.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <string>

#include <dlfcn.h>
#include <sys/socket.h>

namespace {

std::atomic<int> fails_with{0};
std::atomic<int> attempts{0};

} // namespace

// Replaces the C library's function in the whole program: fails when a test requires it.
extern "C" int accept4(int descriptor, sockaddr* address, socklen_t* length, int flags) {
    using function = int (*)(int, sockaddr*, socklen_t*, int);
    static const auto real = reinterpret_cast<function>(::dlsym(RTLD_NEXT, "accept4"));
    if (const auto error = fails_with.load()) {
        ++attempts;
        errno = error;
        return -1;
    }
    return real(descriptor, address, length, flags);
}

BOOST_AUTO_TEST_SUITE(acceptor)

using namespace cles::test;
using namespace std::chrono_literals;

namespace {

constexpr std::array shortages{EMFILE, ENFILE, ENOBUFS, ENOMEM, EPERM};

} // namespace

// The connection stays in the queue, so the socket remains readable.
CLES_DATA_TEST_CASE(it_does_not_spin_and_continues_after_the_shortage, shortages, error) {
    link_pair pair{carrier::tcp4};
    attempts = 0;
    fails_with = error;
    scripted_peer peer{pair.io, to_string(pair.address())};
    bool over = false;
    boost::asio::steady_timer timer{pair.io, 150ms};
    timer.async_wait([&](boost::system::error_code) { over = true; });
    pair.until([&] { return over; });
    fails_with = 0;
    BOOST_TEST(attempts > 0);
    BOOST_TEST(attempts <= 3);
    pair.accept();
}

BOOST_AUTO_TEST_CASE(a_connection_that_failed_before_it_was_accepted_holds_up_no_other) {
    link_pair pair{carrier::tcp4};
    attempts = 0;
    fails_with = EHOSTUNREACH;
    scripted_peer peer{pair.io, to_string(pair.address())};
    pair.until([&] {
        if (attempts > 3) {
            fails_with = 0;
        }
        return attempts > 3;
    });
    pair.accept();
}

BOOST_AUTO_TEST_SUITE_END()
