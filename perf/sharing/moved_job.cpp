// SPDX-License-Identifier: BSL-1.0
// How much longer an empty job takes that moves than one that runs at the node to which it is sent, in round trips
// between client and node. Prints medians.
//
//   cles_moved_job DIRECT BUSY [SAMPLES]
//
// Both are URLs of daemons that have one worker each and offer the tasks of the plugin `work`. DIRECT, of any name,
// runs its jobs itself. BUSY shares its jobs with the node "free"; its worker is held by a job meanwhile. One request
// is in flight at a time, and the three kinds alternate in groups.
#include <cles/service.hpp>

#include "perf/support/latency_recorder.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/describe/class.hpp>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <utility>

namespace {

using namespace std::chrono_literals;
using clock_type = std::chrono::steady_clock;

constexpr std::size_t group = 50;

struct ran {
    std::string node;
};
BOOST_DESCRIBE_STRUCT(ran, (), (node))

class client {
  public:
    client(std::string direct, std::string busy) : direct_(std::move(direct)), busy_(std::move(busy)) {}

    /// Occupies the only worker of the busy node.
    void hold_worker() {
        node_.async_delegate<ran>("self:sleep/600000", cles::json_text{"{}"}, at(busy_, 610s),
                                  [](boost::system::error_code, const ran&) {});
        io_.run_for(300ms);
    }
    void pull(cles::perf::latency_recorder& to) {
        timed(to, [&](auto done) { node_.async_pull<int>("self:nothing", at(direct_, 5s), std::move(done)); });
    }
    /// A job for one of the two, which moves unless it is `direct`.
    void job(bool direct, cles::perf::latency_recorder& to) {
        timed(to, [&](auto done) {
            node_.async_delegate<ran>("self:sleep/0", cles::json_text{"{}"}, at(direct ? direct_ : busy_, 5s),
                                      [=, this](boost::system::error_code code, const ran& where) {
                                          elsewhere_ += direct == (where.node == "free") ? 1 : 0;
                                          done(code, 0);
                                      });
        });
    }
    [[nodiscard]] std::size_t elsewhere() const noexcept { return elsewhere_; }

  private:
    static cles::call_options at(const std::string& url, std::chrono::milliseconds limit) {
        cles::call_options options;
        return options.at(url).deadline(limit);
    }
    template <class Start>
    void timed(cles::perf::latency_recorder& to, Start start) {
        over_ = false;
        const auto begun = clock_type::now();
        start([this](boost::system::error_code code, int) {
            if (code) {
                throw cles::error(code, "a request failed");
            }
            over_ = true;
        });
        while (!over_) {
            io_.restart();
            io_.run_one();
        }
        to.record(clock_type::now() - begun);
    }

    std::string direct_;
    std::string busy_;
    boost::asio::io_context io_{1};
    cles::service node_{io_, {.name = "measuring"}};
    std::size_t elsewhere_ = 0;
    bool over_ = false;
};

double us(cles::perf::latency_recorder& all) { return all.quantiles().p50; }

} // namespace

int main(int argc, char** argv) try {
    if (argc < 3) {
        std::fputs("usage: cles_moved_job DIRECT BUSY [SAMPLES]\n", stderr);
        return 2;
    }
    const std::size_t wanted = argc > 3 ? std::strtoul(argv[3], nullptr, 10) : 1000;
    const auto samples = (wanted + group - 1) / group * group;
    client by{argv[1], argv[2]};
    cles::perf::latency_recorder trips{samples};
    cles::perf::latency_recorder direct{samples};
    cles::perf::latency_recorder moved{samples};
    by.hold_worker();
    cles::perf::latency_recorder first{2 * group};
    for (std::size_t i = 0; i < group; ++i) {
        by.job(true, first);
        by.job(false, first);
    }
    for (std::size_t done = 0; done < samples; done += group) {
        for (std::size_t i = 0; i < group; ++i) {
            by.pull(trips);
        }
        for (std::size_t i = 0; i < group; ++i) {
            by.job(true, direct);
        }
        for (std::size_t i = 0; i < group; ++i) {
            by.job(false, moved);
        }
    }
    std::printf("{\"round_trip_us\":%.1f,\"direct_us\":%.1f,\"moved_us\":%.1f,\"more_round_trips\":%.2f,"
                "\"not_moved\":%zu}\n",
                us(trips), us(direct), us(moved), (us(moved) - us(direct)) / us(trips), by.elsewhere());
    std::fflush(stdout);
    std::_Exit(0); // the job that holds the worker ends with its daemon
} catch (const std::exception& e) {
    std::fprintf(stderr, "cles_moved_job: %s\n", e.what());
    return 1;
}
