// SPDX-License-Identifier: BSL-1.0
// A bridge for perf/federation/faults.py, which kills it: it marks in a file what it has executed, and publishes
// `ticks` 100 times a second.
//
//     cles_federation_node NATS POOL NAME LISTEN SEED MARKS
#include <cles/federation.hpp>
#include <cles/request.hpp>
#include <cles/routing.hpp>
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/describe/class.hpp>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>

#include <fcntl.h>
#include <unistd.h>

namespace {

struct tick {
    std::uint64_t n = 0;
};
BOOST_DESCRIBE_STRUCT(tick, (), (n))

/// The effect of a request. A single write at the end of the file, so that lines of several nodes do not mix.
class marks {
  public:
    explicit marks(const char* path) : file_(::open(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600)) {
        if (file_ < 0) {
            throw std::runtime_error{"there is no file for marks"};
        }
    }
    void leave(const cles::request& asked) const {
        const auto line = std::string{asked.parameter(0)} + " " + std::string{asked.node()} + "\n";
        if (::write(file_, line.data(), line.size()) != static_cast<ssize_t>(line.size())) {
            throw std::runtime_error{"the mark was not written"};
        }
    }

  private:
    int file_;
};

class ticker {
  public:
    ticker(boost::asio::io_context& io, cles::service& by) : timer_(io), by_(by) { wait(); }

  private:
    void wait() {
        constexpr std::chrono::milliseconds interval{10};
        due_ += interval;
        timer_.expires_at(due_);
        timer_.async_wait([this](boost::system::error_code) {
            by_.update("ticks", tick{++count_});
            wait();
        });
    }

    boost::asio::steady_timer timer_;
    cles::service& by_;
    std::chrono::steady_clock::time_point due_ = std::chrono::steady_clock::now();
    std::uint64_t count_ = 0;
};

void run(char** arguments) {
    boost::asio::io_context io{1};
    cles::service_options options{.name = arguments[3], .listen = {arguments[4]}};
    options.routing = cles::routing();
    options.insecure = true;
    options.federation = cles::federation({.servers = {arguments[1]}, .pool = arguments[2]});
    const std::string seed = arguments[5];
    options.gossip = seed.empty() ? cles::gossip() : cles::gossip({seed});
    cles::service node{io, options};
    const marks effects{arguments[6]};
    node.on_delegate("once", [&effects](const cles::request& asked) {
        effects.leave(asked);
        return std::string{asked.node()};
    });
    const ticker ticks{io, node};
    std::printf("%s\n", node.endpoints().front().c_str());
    std::fflush(stdout);
    io.run();
}

} // namespace

int main(int argc, char** argv) {
    constexpr int expected = 7;
    if (argc != expected) {
        std::fputs("usage: cles_federation_node NATS POOL NAME LISTEN SEED MARKS\n", stderr);
        return 2;
    }
    try {
        run(argv);
    } catch (const std::exception& failure) {
        std::fprintf(stderr, "cles_federation_node: %s\n", failure.what());
        return 1;
    }
}
