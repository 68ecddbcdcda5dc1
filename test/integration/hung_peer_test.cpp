// SPDX-License-Identifier: BSL-1.0
// A node whose process hangs: its links stay open, and its host goes on acknowledging what arrives.

#include <cles/gossip.hpp>
#include <cles/responder.hpp>
#include <cles/service.hpp>

#include "support/answer.hpp"
#include "support/data_test_case.hpp"
#include "support/feed_log.hpp"
#include "support/link_pair.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <array>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>

#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

BOOST_AUTO_TEST_SUITE(hung_peer)

using namespace cles::test;
using namespace std::chrono_literals;
using cles::errc;

namespace {

/// A process with the node `car1`, which publishes one value and never finishes a job. Make it first: the child
/// inherits what this process has.
class publisher_process {
  public:
    explicit publisher_process(carrier kind) {
        std::array<int, 2> ends{};
        BOOST_REQUIRE(::pipe(ends.data()) == 0);
        process_ = ::fork();
        BOOST_REQUIRE(process_ >= 0);
        if (process_ == 0) {
            ::prctl(PR_SET_PDEATHSIG, SIGKILL);
            ::close(ends[0]);
            try {
                serve(kind, ends[1]);
            } catch (...) {
                ::_exit(1);
            }
            ::_exit(0);
        }
        ::close(ends[1]);
        std::array<char, 256> text{};
        const auto size = ::read(ends[0], text.data(), text.size());
        ::close(ends[0]);
        BOOST_REQUIRE(size > 0);
        url_.assign(text.data(), static_cast<std::size_t>(size));
    }
    publisher_process(const publisher_process&) = delete;
    publisher_process& operator=(const publisher_process&) = delete;
    ~publisher_process() {
        send(SIGKILL);
        ::waitpid(process_, nullptr, 0);
        if (const std::string scheme{"unix://"}; url_.starts_with(scheme)) {
            ::unlink(url_.c_str() + scheme.size());
        }
    }

    void send(int signal) const { ::kill(process_, signal); }
    [[nodiscard]] const std::string& url() const noexcept { return url_; }

  private:
    static void serve(carrier kind, int to) {
        boost::asio::io_context io;
        cles::service_options options{.name = "car1"};
        options.listen = {fresh_address(kind)};
        options.gossip = cles::gossip();
        cles::service car{io, std::move(options)};
        car.update("place", 1);
        std::optional<cles::responder> held;
        car.on_delegate("work", [&](const cles::request&, cles::responder answer) { held = std::move(answer); });
        const auto url = car.endpoints().front();
        if (::write(to, url.data(), url.size()) != static_cast<ssize_t>(url.size())) {
            ::_exit(1);
        }
        ::close(to);
        io.run();
    }

    pid_t process_ = -1;
    std::string url_;
};

constexpr std::array carriers{carrier::tcp4, carrier::unix_file};

} // namespace

CLES_DATA_TEST_CASE(a_publisher_that_hangs_is_lost_and_bound_again_when_it_goes_on, carriers, kind) {
    const publisher_process car{kind};
    boost::asio::io_context io;
    cles::service_options options{.name = "tower"};
    options.gossip = cles::gossip({car.url()});
    options.limits.silence = 3s;
    cles::service tower{io, std::move(options)};
    feed_log feed;
    feed.bind(tower, "car1:place");
    run_until(io, [&] { return feed.items.size() == 1; });
    answer<> job;
    tower.async_request("DELEGATE car1:work", job.options(), job.take());
    const auto twice_the_limit = std::chrono::steady_clock::now() + 6s;
    run_until(io, [&] { return std::chrono::steady_clock::now() > twice_the_limit; });
    BOOST_TEST(!job.done()); // a silent node that lives is not lost
    BOOST_TEST(feed.count(cles::feed_event::lost) == 0U);

    car.send(SIGSTOP);
    run_until(io, [&] { return feed.count(cles::feed_event::lost) == 1 && job.done(); });
    BOOST_TEST(job.code == errc::unavailable);
    BOOST_TEST(job.words.find("silent for 3000 ms") != std::string::npos, job.words);

    car.send(SIGCONT);
    run_until(io, [&] { return feed.count(cles::feed_event::rebound) == 1; });
}

BOOST_AUTO_TEST_SUITE_END()
