// SPDX-License-Identifier: BSL-1.0
// Which user listens at a Unix socket, and whether a link to it is made.

#include "support/data_test_case.hpp"
#include "support/link_pair.hpp"
#include "transport/transports.hpp"

#include <boost/test/unit_test.hpp>

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <dlfcn.h>
#include <sys/socket.h>
#include <unistd.h>

namespace {

constexpr std::int64_t nobody_else = -1;
std::atomic<std::int64_t> other_user{nobody_else};

} // namespace

// Replaces the C library's function in the whole program: reports another user when a test requires it.
extern "C" int getsockopt(int descriptor, int level, int option, void* value, socklen_t* length) noexcept {
    using function = int (*)(int, int, int, void*, socklen_t*);
    static const auto real = reinterpret_cast<function>(::dlsym(RTLD_NEXT, "getsockopt"));
    const int result = real(descriptor, level, option, value, length);
    const auto user = other_user.load();
    if (result == 0 && level == SOL_SOCKET && option == SO_PEERCRED && user != nobody_else) {
        static_cast<ucred*>(value)->uid = static_cast<uid_t>(user);
    }
    return result;
}

namespace unix_users {
namespace {

using namespace cles::test;

constexpr std::array unix_sockets{carrier::unix_file, carrier::unix_abstract};
constexpr std::uint32_t stranger = 4711;

/// A listener of a user, and what a transport that knows `users` makes of it.
struct fixture {
    ~fixture() { other_user = nobody_else; }

    /// Empty if a link was made, or why not.
    std::string dial(carrier kind, std::uint32_t user, cles::transport::user_names users, std::string_view node = {}) {
        link_pair pair{kind};
        other_user = user;
        const auto by = cles::transport::make_unix(std::move(users));
        std::optional<boost::system::error_code> found;
        cles::link_ptr link;
        const auto give_up = by->dial_node(pair.io.get_executor(), pair.address(), node, pair.bounds(),
                                           [&](boost::system::error_code code, cles::link_ptr made) {
                                               found = code;
                                               link = std::move(made);
                                           });
        pair.until([&] { return found.has_value(); });
        BOOST_TEST((link == nullptr) == found->failed());
        if (*found) {
            BOOST_TEST((*found == boost::system::errc::permission_denied));
            return found->message();
        }
        BOOST_TEST(link->peer().uid.value_or(0) == user);
        BOOST_TEST(link->peer().name == ""); // it has proved none
        link->close();
        return {};
    }
};

const std::string refused =
    "user 4711 listens there, who is neither root, nor the user of this process, nor stated to be that node";

} // namespace

BOOST_FIXTURE_TEST_SUITE(unix_users, fixture)

CLES_DATA_TEST_CASE(another_users_listener_is_refused, unix_sockets, kind) {
    BOOST_TEST(dial(kind, stranger, {{0, "car1"}, {::geteuid(), "car1"}}) == refused);
    BOOST_TEST(dial(kind, stranger, {{stranger + 1, "car2"}}, "car2") == refused);
}

CLES_DATA_TEST_CASE(roots_and_the_own_users_listener_is_any_node, unix_sockets, kind) {
    for (const auto user : {std::uint32_t{0}, static_cast<std::uint32_t>(::geteuid())}) {
        for (const auto* node : {"", "car1", "car2"}) {
            BOOST_TEST(dial(kind, user, {{stranger, "car1"}}, node) == "");
        }
    }
}

CLES_DATA_TEST_CASE(a_stated_users_listener_is_that_node_and_no_other, unix_sockets, kind) {
    const cles::transport::user_names users{{stranger, "car1"}};
    BOOST_TEST(dial(kind, stranger, users, "car1") == "");
    BOOST_TEST(dial(kind, stranger, users) == ""); // any node is wanted
    BOOST_TEST(dial(kind, stranger, users, "car2") == refused);
}

CLES_DATA_TEST_CASE(without_users_every_listener_is_accepted, unix_sockets, kind) {
    BOOST_TEST(dial(kind, stranger, {}, "car1") == "");
}

BOOST_AUTO_TEST_SUITE_END()

} // namespace unix_users
