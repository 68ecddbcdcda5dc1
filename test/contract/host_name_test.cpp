// SPDX-License-Identifier: BSL-1.0
// A host name is resolved in parallel with the event loop, which continues meanwhile.

#include "support/data_test_case.hpp"
#include "support/link_pair.hpp"
#include "support/run_until.hpp"
#include "support/test_suite.hpp"

#include <boost/asio/error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <iterator>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include <dlfcn.h>
#include <netdb.h>

namespace {

/// Replaces the system's resolver: names that end in ".slow.test" wait until they are released; others in ".test"
/// resolve to this host.
class resolver_stand_in {
  public:
    static resolver_stand_in& get() {
        static resolver_stand_in instance;
        return instance;
    }
    void hold() {
        const std::lock_guard lock{mutex_};
        open_ = false;
    }
    void let_go() {
        const std::lock_guard lock{mutex_};
        open_ = true;
        changed_.notify_all();
    }
    void wait() {
        std::unique_lock lock{mutex_};
        changed_.wait(lock, [this] { return open_; });
    }

  private:
    std::mutex mutex_;
    std::condition_variable changed_;
    bool open_ = true;
};

} // namespace

// Replaces the C library's function in the whole program.
extern "C" int getaddrinfo(const char* node, const char* service, const addrinfo* hints, addrinfo** result) {
    using function = int (*)(const char*, const char*, const addrinfo*, addrinfo**);
    static const auto real = reinterpret_cast<function>(::dlsym(RTLD_NEXT, "getaddrinfo"));
    const std::string_view name = node == nullptr ? "" : node;
    if (!name.ends_with(".test")) {
        return real(node, service, hints, result);
    }
    if (name.ends_with(".slow.test")) {
        resolver_stand_in::get().wait();
    }
    return name.starts_with("nobody.") ? EAI_NONAME : real("127.0.0.1", service, hints, result);
}

CLES_TEST_SUITE(host_name)

using namespace cles::test;
using namespace std::chrono_literals;
namespace asio = boost::asio;

const std::array schemes{std::string{"tcp"}, std::string{"udp"}};

std::ptrdiff_t threads() {
    return std::distance(std::filesystem::directory_iterator{"/proc/self/task"}, std::filesystem::directory_iterator{});
}

/// While it exists, slow names are slow.
struct slowness {
    slowness() { resolver_stand_in::get().hold(); }
    ~slowness() { resolver_stand_in::get().let_go(); }
};

struct dialled {
    dialled(asio::io_context& io, const std::string& url, std::chrono::milliseconds within = 20s)
        : give_up(cles::find_transport(cles::parse_url(url).scheme)
                      ->dial(io.get_executor(), cles::parse_url(url), {.connect = within},
                             [this](boost::system::error_code failed, cles::link_ptr made) {
                                 ++calls;
                                 code = failed;
                                 link = std::move(made);
                             })) {}
    ~dialled() {
        if (link) {
            link->close();
        }
    }

    int calls = 0;
    boost::system::error_code code;
    cles::link_ptr link;
    std::function<void()> give_up;
};

CLES_DATA_TEST_CASE(a_name_leads_to_its_host, schemes, scheme) {
    asio::io_context io;
    auto at = cles::find_transport(scheme)->listen(io.get_executor(), cles::parse_url(scheme + "://127.0.0.1:0"), {});
    dialled one{io, scheme + "://car1.test:" + std::to_string(at->local().port)};
    run_until(io, [&] { return one.calls != 0; });
    BOOST_TEST(!one.code);
    BOOST_TEST(one.link->peer().address == to_string(at->local()));
}

CLES_DATA_TEST_CASE(an_unknown_name_is_an_error, schemes, scheme) {
    asio::io_context io;
    dialled one{io, scheme + "://nobody.test:4000"};
    run_until(io, [&] { return one.calls != 0; });
    BOOST_TEST((one.code == asio::error::host_not_found));
}

CLES_DATA_TEST_CASE(while_a_name_is_resolved_the_loop_runs_and_the_time_is_bounded, schemes, scheme) {
    asio::io_context io;
    const slowness names;
    dialled one{io, scheme + "://car1.slow.test:4000", 100ms};
    int turns = 0;
    asio::steady_timer timer{io};
    const std::function<void(boost::system::error_code)> turn = [&](boost::system::error_code code) {
        if (!code && one.calls == 0) {
            ++turns;
            timer.expires_after(1ms);
            timer.async_wait(turn);
        }
    };
    turn({});
    run_until(io, [&] { return one.calls != 0; });
    BOOST_TEST((one.code == asio::error::timed_out));
    BOOST_TEST(turns > 2);
}

CLES_DATA_TEST_CASE(a_cancelled_lookup_does_not_report, schemes, scheme) {
    asio::io_context io;
    auto names = std::make_unique<slowness>();
    dialled one{io, scheme + "://car1.slow.test:4000"};
    dialled next{io, scheme + "://car2.slow.test:4000"}; // waits for the reply of the other lookup
    run_ready(io);
    one.give_up();
    next.give_up();
    run_ready(io);
    names.reset();
    io.restart();
    io.run(); // until the system has replied
    BOOST_TEST(one.calls == 0);
    BOOST_TEST(next.calls == 0);
}

CLES_DATA_TEST_CASE(the_first_name_starts_the_one_thread_and_addresses_never_do, schemes, scheme) {
    asio::io_context io;
    auto at = cles::find_transport(scheme)->listen(io.get_executor(), cles::parse_url(scheme + "://127.0.0.1:0"), {});
    const auto port = std::to_string(at->local().port);
    const auto before = threads();
    for (const auto* host : {"127.0.0.1", "localhost"}) {
        dialled one{io, scheme + "://" + host + ":" + port};
        run_until(io, [&] { return one.calls != 0; });
        BOOST_TEST(!one.code, host);
    }
    BOOST_TEST(threads() == before);
    for (const auto* host : {"car1.test", "car2.test", "nobody.test"}) {
        dialled one{io, scheme + "://" + host + ":" + port};
        run_until(io, [&] { return one.calls != 0; });
        BOOST_TEST(threads() == before + 1, host);
    }
}

BOOST_AUTO_TEST_SUITE_END()
