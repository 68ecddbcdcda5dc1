// SPDX-License-Identifier: BSL-1.0
// Many pools of nodes in one process, each with a bridge, through one server of NATS: how long it takes until all are
// found and reachable; then updates of one node to bridges of ten pools. Prints a line of JSON for each; between them,
// it waits for a line on stdin.
//
//     cles_federation_pools URL [POOLS [NODES]]      perf/federation/measure.py starts a server for it
#include <cles/convert.hpp>
#include <cles/federation.hpp>
#include <cles/feed.hpp>
#include <cles/routing.hpp>
#include <cles/service.hpp>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/streambuf.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/describe/class.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <fcntl.h>
#include <unistd.h>

namespace {

using namespace std::chrono_literals;
namespace asio = boost::asio;
using steady = std::chrono::steady_clock;

struct tick {
    std::uint64_t n = 0;
};
BOOST_DESCRIBE_STRUCT(tick, (), (n))

struct known_pool {
    std::string state;
    std::uint64_t nodes = 0;
};
BOOST_DESCRIBE_STRUCT(known_pool, (), (state, nodes))

struct bridge_metrics {
    std::vector<known_pool> pools;
    std::uint64_t updates_sent = 0;
};
BOOST_DESCRIBE_STRUCT(bridge_metrics, (), (pools, updates_sent))

struct metrics {
    bridge_metrics federation;
};
BOOST_DESCRIBE_STRUCT(metrics, (), (federation))

double seconds_since(steady::time_point begun) { return std::chrono::duration<double>(steady::now() - begun).count(); }

std::string pool_name(std::size_t pool) { return "p" + std::to_string(pool); }
std::string node_name(std::size_t pool, std::size_t node) { return pool_name(pool) + "-n" + std::to_string(node); }

class fleet {
  public:
    fleet(asio::io_context& io, const std::string& url, std::size_t pools, std::size_t nodes)
        : io_(io), pools_(pools), nodes_(nodes) {
        for (std::size_t pool = 0; pool < pools; ++pool) {
            std::vector<std::string> seeds;
            for (std::size_t node = 0; node < nodes; ++node) {
                cles::service_options options{.name = node_name(pool, node), .listen = {"tcp://127.0.0.1:0"}};
                options.routing = cles::routing();
                options.gossip = cles::gossip(seeds);
                options.pool = pool_name(pool);
                if (node == 0) {
                    options.insecure = true;
                    options.federation = cles::federation({.servers = {url}, .pool = pool_name(pool)});
                }
                auto made = std::make_unique<cles::service>(io, options);
                made->on_pull("who", [name = options.name] { return name; });
                if (node == 0) {
                    seeds = made->endpoints();
                }
                all_.push_back(std::move(made));
            }
        }
    }

    asio::awaitable<void> run() {
        const auto begun = begun_;
        for (std::size_t pool = 0; pool < pools_; ++pool) {
            while (!co_await knows_all(bridge(pool))) {
                co_await pause(10ms);
            }
        }
        const auto found = seconds_since(begun);
        std::size_t again = 0;
        for (std::size_t from = 0; from < pools_; ++from) {
            for (std::size_t pool = 0; pool < pools_; ++pool) {
                for (std::size_t node = 0; from != pool && node < nodes_; ++node) {
                    while (!co_await reaches(bridge(from), pool, node)) {
                        ++again;
                        co_await pause(10ms);
                    }
                }
            }
        }
        std::printf(R"({"pools":%zu,"nodes":%zu,"found_s":%.2f,"reachable_s":%.2f,"requests":%zu,"repeated":%zu})"
                    "\n",
                    pools_, nodes_, found, seconds_since(begun), pools_ * (pools_ - 1) * nodes_, again);
        std::fflush(stdout);
        co_await wait_for_line();
        co_await measure_updates();
        io_.stop();
    }

  private:
    cles::service& bridge(std::size_t pool) { return *all_[pool * nodes_]; }

    asio::awaitable<void> pause(std::chrono::milliseconds time) {
        asio::steady_timer timer{io_, time};
        co_await timer.async_wait(asio::use_awaitable);
    }

    asio::awaitable<void> wait_for_line() {
        asio::posix::stream_descriptor in{io_, ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0)};
        asio::streambuf line;
        co_await asio::async_read_until(in, line, '\n', asio::use_awaitable);
    }

    asio::awaitable<bool> knows_all(cles::service& at) {
        const auto stated = co_await at.async_pull<metrics>("self:cles/metrics");
        std::size_t live = 0;
        std::size_t nodes = 0;
        for (const auto& pool : stated.federation.pools) {
            live += pool.state == "live" ? 1U : 0U;
            nodes += pool.nodes;
        }
        co_return live == pools_ - 1 && nodes == (pools_ - 1) * nodes_;
    }

    asio::awaitable<bool> reaches(cles::service& from, std::size_t pool, std::size_t node) {
        const auto name = node_name(pool, node);
        const auto noun = pool_name(pool) + "." + name + ":who"; // a bare name would be reached within the process
        std::string answer;
        try {
            answer = co_await from.async_pull<std::string>(noun);
        } catch (const std::exception&) {
            co_return false;
        }
        if (answer != name) {
            throw std::runtime_error{noun + " was answered by " + answer};
        }
        co_return true;
    }

    asio::awaitable<void> read(cles::service& at) {
        auto feed = co_await at.async_bind<tick>("p0.p0-n0:ticks", cles::bind_options{}.keep(1024));
        ++bound_;
        for (;;) {
            const auto item = co_await feed.async_next();
            received_ += item.kind == cles::feed_event::update ? 1U : 0U;
        }
    }

    // Two readers in each of ten pools.
    asio::awaitable<void> measure_updates() {
        constexpr std::size_t readers_per_pool = 2;
        constexpr std::uint64_t count = 1'000;
        const auto others = std::min<std::size_t>(pools_ - 1, 10);
        const auto readers = others * readers_per_pool;
        bridge(0).update("ticks", tick{});
        for (std::size_t reader = 0; reader < readers; ++reader) {
            asio::co_spawn(io_, read(bridge(1 + reader % others)), asio::detached);
        }
        while (bound_ != readers) {
            co_await pause(10ms);
        }
        co_await pause(500ms); // the first value, which each reader gets by itself
        const auto before = co_await bridge(0).async_pull<metrics>("self:cles/metrics");
        received_ = 0;
        for (std::uint64_t n = 1; n <= count; ++n) {
            bridge(0).update("ticks", tick{n});
            co_await pause(1ms);
        }
        const auto until = steady::now() + 5s;
        while (received_ < count * readers && steady::now() < until) {
            co_await pause(10ms);
        }
        const auto after = co_await bridge(0).async_pull<metrics>("self:cles/metrics");
        const auto published = after.federation.updates_sent - before.federation.updates_sent;
        std::printf(R"({"updates":%ju,"reading_pools":%zu,"readers":%zu,"received":%ju,"publications":%ju})"
                    "\n",
                    std::uintmax_t{count}, others, readers, std::uintmax_t{received_}, std::uintmax_t{published});
        std::fflush(stdout);
    }

    asio::io_context& io_;
    const std::size_t pools_;
    const std::size_t nodes_;
    const steady::time_point begun_ = steady::now();
    std::size_t bound_ = 0;      // readers of updates
    std::uint64_t received_ = 0; // by them
    std::vector<std::unique_ptr<cles::service>> all_;
};

std::size_t number(int argc, char** argv, int at, std::size_t usual) {
    return argc > at ? std::strtoul(argv[at], nullptr, 10) : usual;
}

} // namespace

int main(int argc, char** argv) {
    if (argc < 2) {
        std::fputs("usage: cles_federation_pools URL [POOLS [NODES]]\n", stderr);
        return 2;
    }
    try {
        asio::io_context io{1};
        fleet all{io, argv[1], number(argc, argv, 2, 20), number(argc, argv, 3, 5)};
        std::exception_ptr failure;
        asio::co_spawn(io, all.run(), [&](std::exception_ptr why) {
            failure = why;
            io.stop();
        });
        io.run();
        if (failure) {
            std::rethrow_exception(failure);
        }
        std::_Exit(0); // the threads of the bridges
    } catch (const std::exception& failure) {
        std::fprintf(stderr, "cles_federation_pools: %s\n", failure.what());
        std::_Exit(1);
    }
}
