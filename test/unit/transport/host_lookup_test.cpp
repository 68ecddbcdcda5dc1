// SPDX-License-Identifier: BSL-1.0
// Lookups on threads that the test starts when it wants, or refuses.

#include "support/run_until.hpp"
#include "transport/host_lookup.hpp"
#include "transport/lookup_error.hpp"
#include "transport/lookup_threads.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <cerrno>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace host_lookup {
namespace {

using boost::system::error_code;
using cles::test::run_ready;
using cles::transport::lookup_errc;
using cles::transport::lookup_threads;
using lookup = cles::transport::host_lookup;
using namespace std::chrono_literals;

// A name to which the system's resolver replies without asking anybody.
const std::string name = "127.1";

struct fixture {
    struct asked {
        std::shared_ptr<lookup> by;
        int calls = 0;
        error_code code{};
        std::size_t found = 0;
    };

    std::shared_ptr<asked> ask(const std::string& host, std::chrono::milliseconds within = 1h) {
        const auto one = std::make_shared<asked>();
        one->by =
            std::make_shared<lookup>(io->get_executor(), cles::url{.scheme = "tcp", .host = host, .port = 1}, threads);
        one->by->start(within, [one = one.get()](error_code code, const auto& found) {
            ++one->calls;
            one->code = code;
            one->found = found.size();
        });
        return one;
    }
    void run_threads() {
        for (const auto& function : std::exchange(started, {})) {
            function();
        }
    }

    std::optional<boost::asio::io_context> io{std::in_place};
    bool refuses = false;
    std::vector<std::function<void()>> started;
    std::shared_ptr<lookup_threads> threads =
        std::make_shared<lookup_threads>([this](std::function<void()> function) -> error_code {
            if (refuses) {
                return {EAGAIN, boost::system::system_category()};
            }
            started.push_back(std::move(function));
            return {};
        });
};

} // namespace
} // namespace host_lookup

BOOST_FIXTURE_TEST_SUITE(host_lookup, fixture)

BOOST_AUTO_TEST_CASE(the_outcome_arrives_on_the_executor) {
    const auto one = ask(name);
    const auto other = ask(name);
    BOOST_TEST(started.size() == 1U);
    run_threads();
    BOOST_TEST(one->calls == 0);
    run_ready(*io);
    BOOST_TEST(one->calls == 1);
    BOOST_TEST(!one->code);
    BOOST_TEST(one->found == 1U);
    BOOST_TEST(other->calls == 1);
    const auto later = ask(name); // it is still known
    BOOST_TEST(started.empty());
    run_ready(*io);
    BOOST_TEST(later->found == 1U);
}

BOOST_AUTO_TEST_CASE(a_thread_that_the_system_refuses_is_an_error_of_the_request) {
    refuses = true;
    const auto one = ask(name);
    BOOST_TEST(one->calls == 0);
    run_ready(*io);
    BOOST_TEST(one->calls == 1);
    BOOST_TEST((one->code == lookup_errc::no_thread));
    refuses = false;
    const auto other = ask(name);
    run_threads();
    run_ready(*io);
    BOOST_TEST(!other->code);
}

BOOST_AUTO_TEST_CASE(what_takes_too_long_is_said_to_be_the_lookup) {
    const auto one = ask(name, 1ms);
    cles::test::run_until(*io, [&] { return one->calls != 0; });
    BOOST_TEST((one->code == boost::system::errc::timed_out));
    BOOST_TEST(one->code.message() == "the name of its host could not be looked up in time");
    run_threads(); // too late
    run_ready(*io);
    BOOST_TEST(one->calls == 1);
}

BOOST_AUTO_TEST_CASE(nothing_runs_for_a_lookup_that_was_given_up) {
    const auto one = ask(name);
    one->by->give_up();
    BOOST_TEST(io->run() > 0U); // ends: the timer was cancelled
    run_threads();
    run_ready(*io);
    BOOST_TEST(one->calls == 0);
}

BOOST_AUTO_TEST_CASE(a_thread_may_end_after_the_context) {
    const auto one = ask(name);
    one->by.reset();
    threads->close(); // as the context does when it is destroyed
    io.reset();
    threads.reset();
    run_threads();
    BOOST_TEST(one->calls == 0);
}

BOOST_AUTO_TEST_CASE(a_child_process_looks_up_again_what_only_the_parent_does) {
    const auto one = ask(name);
    started.clear(); // the threads of the parent
    threads->before_fork();
    threads->after_fork(true);
    BOOST_TEST(started.size() == 1U);
    run_threads();
    run_ready(*io);
    BOOST_TEST(one->calls == 1);
    BOOST_TEST(!one->code);
}

BOOST_AUTO_TEST_SUITE_END()
