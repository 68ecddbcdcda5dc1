// SPDX-License-Identifier: BSL-1.0
// How links are made: listening, dialling, and the identity of the peer.

#include <cles/error.hpp>

#include "support/data_test_case.hpp"
#include "support/link_pair.hpp"
#include "support/scripted_peer.hpp"
#include "transport/transports.hpp"

#include <boost/asio/error.hpp>
#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <sys/stat.h>
#include <unistd.h>

BOOST_AUTO_TEST_SUITE(transport)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;

struct dial_result {
    int calls = 0;
    boost::system::error_code code{};
    cles::link_ptr made{};

    cles::dial_callback callback() {
        return [this](boost::system::error_code failed, cles::link_ptr link) {
            ++calls;
            code = failed;
            made = std::move(link);
        };
    }
};

namespace {

boost::system::error_code listen_failure(asio::io_context& io, const cles::url& where) {
    try {
        cles::find_transport(where.scheme)->listen(io.get_executor(), where, {});
    } catch (const boost::system::system_error& e) {
        return e.code();
    }
    return {};
}

} // namespace

BOOST_AUTO_TEST_CASE(an_unregistered_scheme_has_no_transport) {
    BOOST_TEST(cles::find_transport("smoke") == nullptr);
    BOOST_TEST(cles::find_transport("") == nullptr);
}

CLES_DATA_TEST_CASE(the_acceptor_knows_its_real_address, listening_carriers, kind) {
    link_pair pair{kind};
    if (pair.address().scheme == "tcp" || pair.address().scheme == "tls" || pair.address().scheme == "udp") {
        BOOST_TEST(pair.address().port != 0);
    }
    const auto again = cles::parse_url(to_string(pair.address()));
    BOOST_TEST(to_string(again) == to_string(pair.address()));
    pair.open();
}

CLES_DATA_TEST_CASE(both_ends_know_who_the_other_is, listening_carriers, kind) {
    link_pair pair{kind};
    pair.connect();
    const auto far = pair.far.run([&] { return pair.far.link->peer(); });
    const auto& near = pair.near.link->peer();
    BOOST_TEST(near.transport == pair.address().scheme);
    BOOST_TEST(far.transport == pair.address().scheme);
    BOOST_TEST(near.address == to_string(pair.address()));
    BOOST_TEST(far.address.starts_with(pair.address().scheme + "://"));
    BOOST_TEST(near.local);
    BOOST_TEST(far.local);
    const std::string name = kind == carrier::tls ? "node" : ""; // the others authenticate none
    BOOST_TEST(near.name == name);
    pair.until([&] { return pair.far.run([&] { return pair.far.link->peer().name == name; }); });
    if (pair.address().scheme == "unix") {
        BOOST_REQUIRE(far.uid.has_value());
        BOOST_TEST(*far.uid == ::getuid());
        BOOST_TEST(far.address == to_string(pair.address()));
    }
}

CLES_DATA_TEST_CASE(many_links_come_in_by_one_acceptor, every_carrier, kind) {
    link_pair pair{kind};
    std::vector<link_end> nears;
    std::vector<link_end> fars;
    for (int i = 0; i < 20; ++i) {
        pair.open();
        nears.push_back(std::exchange(pair.near, {}));
        fars.push_back(pair.far);
        pair.far.link.reset();
        pair.far.events = std::make_shared<link_recorder>();
    }
    for (auto& near : nears) {
        near.say("hello\n");
    }
    for (auto& far : fars) {
        pair.until([&] { return far.lines() == 1; });
    }
    for (auto& far : fars) {
        far.drop();
    }
    for (auto& near : nears) {
        near.drop();
    }
}

CLES_DATA_TEST_CASE(dialling_without_a_listener_is_refused_and_never_inside_the_call, every_carrier, kind) {
    link_pair pair{kind};
    pair.stop_listening();
    dial_result result;
    pair.transport().dial(pair.io.get_executor(), pair.address(), pair.bounds(), result.callback());
    BOOST_TEST(result.calls == 0);
    pair.until([&] { return result.calls != 0; });
    run_ready(pair.io);
    BOOST_TEST(result.calls == 1);
    BOOST_TEST(result.made == nullptr);
    const bool fits =
        result.code == asio::error::connection_refused || result.code == boost::system::errc::no_such_file_or_directory;
    BOOST_TEST(fits, result.code.message());
}

CLES_DATA_TEST_CASE(a_dial_that_was_given_up_never_calls_back, listening_carriers, kind) {
    link_pair pair{kind};
    dial_result result;
    const auto give_up =
        pair.transport().dial(pair.io.get_executor(), pair.address(), pair.bounds(), result.callback());
    give_up();
    give_up();
    run_ready(pair.io);
    BOOST_TEST(result.calls == 0);
    pair.stop_listening();
    const auto refused =
        pair.transport().dial(pair.io.get_executor(), pair.address(), pair.bounds(), result.callback());
    refused();
    run_ready(pair.io);
    BOOST_TEST(result.calls == 0);
}

CLES_DATA_TEST_CASE(giving_up_after_the_dial_ended_does_nothing, every_carrier, kind) {
    link_pair pair{kind};
    dial_result result;
    const auto give_up =
        pair.transport().dial(pair.io.get_executor(), pair.address(), pair.bounds(), result.callback());
    pair.until([&] { return result.calls == 1; });
    pair.accept();
    give_up();
    pair.near.link = std::move(result.made);
    pair.near.start();
    pair.far.start();
    pair.near.say("still there\n");
    pair.until([&] { return pair.far.lines() == 1; });
}

BOOST_AUTO_TEST_CASE(a_connection_that_does_not_come_about_has_timed_out) {
    asio::io_context io;
    const scripted_listener full{io, "tcp://127.0.0.1:0", 0};
    // The kernel completes a few connections that are not accepted; further ones wait.
    std::vector<std::unique_ptr<dial_result>> dials;
    const auto where = cles::parse_url(full.url());
    const cles::limits bounds{.connect = 200ms};
    for (int i = 0; i < 4; ++i) {
        dials.push_back(std::make_unique<dial_result>());
        cles::find_transport("tcp")->dial(io.get_executor(), where, bounds, dials.back()->callback());
    }
    run_until(io, [&] { return std::all_of(dials.begin(), dials.end(), [](const auto& d) { return d->calls == 1; }); });
    BOOST_TEST(dials.back()->code == asio::error::timed_out);
}

// The kernel rejects further connections to a Unix socket whose queue is full at once.
BOOST_AUTO_TEST_CASE(a_unix_socket_whose_queue_is_full_is_an_error_and_no_link) {
    asio::io_context io;
    const auto where = cles::parse_url(fresh_address(carrier::unix_abstract));
    const scripted_listener full{io, to_string(where), 0};
    std::vector<std::unique_ptr<dial_result>> dials;
    for (int i = 0; i < 4; ++i) {
        dials.push_back(std::make_unique<dial_result>());
        cles::find_transport("unix")->dial(io.get_executor(), where, {}, dials.back()->callback());
        run_until(io, [&] { return dials.back()->calls == 1; });
    }
    BOOST_TEST(!dials.front()->code);
    BOOST_TEST(dials.back()->code.failed());
    BOOST_TEST(dials.back()->made == nullptr);
}

CLES_DATA_TEST_CASE(an_address_in_use_is_refused, listening_carriers, kind) {
    link_pair pair{kind};
    asio::io_context other;
    BOOST_TEST(listen_failure(other, pair.address()) == asio::error::address_in_use);
    pair.open(); // and the first one is not affected
}

CLES_DATA_TEST_CASE(an_address_is_free_again_after_its_acceptor_is_destroyed, every_carrier, kind) {
    link_pair pair{kind};
    pair.open();
    pair.stop_listening();
    BOOST_TEST(!listen_failure(pair.io, pair.address()));
    pair.near.say("links outlive their acceptor\n");
    pair.until([&] { return pair.far.lines() == 1; });
}

CLES_DATA_TEST_CASE(nothing_is_accepted_after_an_acceptor_was_closed, every_carrier, kind) {
    link_pair pair{kind};
    dial_result result;
    pair.far.run([&] { // in one step, so that no connection arrives meanwhile
        pair.transport().dial(pair.io.get_executor(), pair.address(), pair.bounds(), result.callback());
        pair.stop_listening();
    });
    pair.until([&] { return result.calls == 1; });
    if (result.made) { // the kernel, or the listener, had accepted it already: then it ends at once
        pair.near.link = std::move(result.made);
        pair.near.start();
        pair.until([&] { return pair.near.over(); });
    }
    BOOST_TEST(pair.far.link == nullptr);
}

BOOST_AUTO_TEST_CASE(an_address_that_is_not_of_this_machine_is_refused) {
    asio::io_context io;
    for (const auto* where : {"tcp://192.0.2.1:0", "udp://192.0.2.1:0"}) {
        BOOST_TEST(listen_failure(io, cles::parse_url(where)) == boost::system::errc::address_not_available);
    }
}

BOOST_AUTO_TEST_CASE(an_unknown_host_name_is_an_error) {
    asio::io_context io;
    for (const std::string scheme : {"tcp", "udp"}) {
        BOOST_TEST(listen_failure(io, cles::parse_url(scheme + "://no.such.host.invalid:0")).failed());
        dial_result result;
        cles::find_transport(scheme)->dial(io.get_executor(), cles::parse_url(scheme + "://no.such.host.invalid:1"), {},
                                           result.callback());
        run_until(io, [&] { return result.calls == 1; });
        BOOST_TEST(result.code.failed());
    }
}

BOOST_AUTO_TEST_CASE(only_loopback_and_what_stays_on_this_host_is_not_exposed) {
    const auto exposed = [](const char* text) {
        const auto where = cles::parse_url(text);
        return cles::find_transport(where.scheme)->is_exposed(where);
    };
    BOOST_TEST(!exposed("tcp://127.0.0.1:0"));
    BOOST_TEST(!exposed("tcp://127.8.9.10:0"));
    BOOST_TEST(!exposed("tcp://[::1]:0"));
    BOOST_TEST(!exposed("tcp://localhost:0"));
    BOOST_TEST(!exposed("unix:///tmp/x"));
    BOOST_TEST(!exposed("inproc://x"));
    BOOST_TEST(!exposed("udp://127.0.0.1:0"));
    BOOST_TEST(!exposed("udp://[::1]:0"));
    BOOST_TEST(exposed("udp://0.0.0.0:0"));
    BOOST_TEST(exposed("udp://[::]:0"));
    BOOST_TEST(exposed("tcp://0.0.0.0:0"));
    BOOST_TEST(exposed("tcp://[::]:0"));
    BOOST_TEST(exposed("tcp://192.0.2.1:0"));
}

// -- socket files --------------------------------------------------------------------------------------------------

namespace {

struct socket_file {
    cles::url where = cles::parse_url(fresh_address(carrier::unix_file));
    ~socket_file() { ::unlink(where.path.c_str()); }

    [[nodiscard]] bool exists() const {
        struct stat found {};
        return ::lstat(where.path.c_str(), &found) == 0;
    }
    [[nodiscard]] unsigned mode() const {
        struct stat found {};
        BOOST_REQUIRE(::stat(where.path.c_str(), &found) == 0);
        return found.st_mode & 07777U;
    }
    [[nodiscard]] std::unique_ptr<cles::acceptor> listen(cles::link_transport& by, asio::io_context& io,
                                                         mode_t umask) const {
        const auto before = ::umask(umask);
        auto door = by.listen(io.get_executor(), where, {});
        ::umask(before);
        return door;
    }
};

} // namespace

BOOST_AUTO_TEST_CASE(a_socket_file_is_accessible_only_to_its_owner_and_removed_with_its_acceptor) {
    asio::io_context io;
    const socket_file file;
    auto door = file.listen(*cles::find_transport("unix"), io, 0);
    BOOST_TEST(file.mode() == 0600U);
    door.reset();
    BOOST_TEST(!file.exists());
    // Those who count as the node itself need no more.
    door = file.listen(*cles::transport::make_unix({{0, "car1"}, {::geteuid(), "car1"}}), io, 0);
    BOOST_TEST(file.mode() == 0600U);
}

BOOST_AUTO_TEST_CASE(a_socket_file_for_other_users_is_accessible_to_them_whatever_the_umask) {
    asio::io_context io;
    const auto by = cles::transport::make_unix({{::geteuid() + 1, "operator"}});
    for (const mode_t umask : {0U, 022U, 077U, 0177U}) {
        const socket_file file;
        const auto door = file.listen(*by, io, umask);
        BOOST_TEST(file.mode() == 0666U);
        door->close();
        BOOST_TEST(!file.exists());
    }
}

BOOST_AUTO_TEST_CASE(a_socket_file_without_a_listener_is_replaced) {
    asio::io_context io;
    const socket_file file;
    { const scripted_listener died{io, to_string(file.where)}; }
    BOOST_REQUIRE(file.exists());
    const auto door = cles::find_transport("unix")->listen(io.get_executor(), file.where, {});
    cles::link_ptr arrived;
    door->start([&](cles::link_ptr link) { arrived = std::move(link); });
    const scripted_peer peer{io, to_string(file.where)};
    run_until(io, [&] { return arrived != nullptr; });
}

BOOST_AUTO_TEST_CASE(a_file_that_is_no_socket_is_left_alone) {
    asio::io_context io;
    const socket_file file;
    std::ofstream{file.where.path} << "precious";
    BOOST_TEST(listen_failure(io, file.where) == asio::error::address_in_use);
    std::string text;
    std::ifstream{file.where.path} >> text;
    BOOST_TEST(text == "precious");
}

BOOST_AUTO_TEST_CASE(a_socket_file_that_was_replaced_meanwhile_is_not_removed) {
    asio::io_context io;
    const socket_file file;
    auto door = cles::find_transport("unix")->listen(io.get_executor(), file.where, {});
    ::unlink(file.where.path.c_str());
    const scripted_listener other{io, to_string(file.where)};
    door.reset();
    BOOST_TEST(file.exists());
}

BOOST_AUTO_TEST_CASE(a_socket_file_in_a_folder_that_is_not_there_is_an_error) {
    asio::io_context io;
    BOOST_TEST(listen_failure(io, cles::parse_url("unix:///no/such/folder/socket")) ==
               boost::system::errc::no_such_file_or_directory);
}

BOOST_AUTO_TEST_SUITE_END()
