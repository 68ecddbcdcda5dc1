// SPDX-License-Identifier: BSL-1.0
// Members of a fleet that have just been started, each twice a second: how many reach a node, and how long that takes.
// Each opens a link by tls or a session by udp, and asks the node once. Prints JSON. perf/tls/floods.py runs it while
// strangers flood the node.
//
//   cles_member_links FLEET MEMBERS URL SECONDS
//
// FLEET contains the keys of `m0`, `m1` ...; `node` listens at URL. With 0 seconds, each member begins once.
#include <cles/security.hpp>
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace {

using namespace std::chrono_literals;
using steady = std::chrono::steady_clock;

constexpr std::chrono::milliseconds between{500}; // beginnings of a member
constexpr std::chrono::milliseconds longest{2'000};

struct outcomes {
    std::size_t begun = 0;
    std::size_t succeeded = 0;
    std::vector<std::chrono::nanoseconds> took{}; // one that has failed took as long as it may

    [[nodiscard]] double quantile(double part) {
        if (took.empty()) {
            return 0;
        }
        std::sort(took.begin(), took.end());
        const auto at = std::min(took.size() - 1, static_cast<std::size_t>(static_cast<double>(took.size()) * part));
        return std::chrono::duration<double, std::milli>(took[at]).count();
    }
};

/// Starts a member, again and again, each time with a service and a context of its own, as a process that has just
/// begun.
class member {
  public:
    member(std::string fleet, std::string name, std::string node)
        : fleet_(std::move(fleet)), name_(std::move(name)), node_(std::move(node)) {}

    /// Starts it at `next`, every `between` after it, and before `end`; at least once.
    void run(steady::time_point next, steady::time_point end) {
        do {
            std::this_thread::sleep_until(next);
            start();
            next += between;
        } while (next < end);
    }

    [[nodiscard]] const outcomes& found() const { return found_; }

  private:
    void start() {
        cles::service_options options{.name = name_};
        options.peers.emplace("node", node_);
        options.security = cles::secured(fleet_ + "/" + name_);
        boost::asio::io_context io{1};
        cles::service started{io, options};
        ++found_.begun;
        const auto begun = steady::now();
        started.async_pull("node:cles", cles::call_options{}.deadline(longest),
                           [&](boost::system::error_code code, const cles::json_text&) {
                               found_.succeeded += code ? 0U : 1U;
                               found_.took.push_back(code ? std::chrono::nanoseconds{longest} : steady::now() - begun);
                               io.stop();
                           });
        io.run();
    }

    std::string fleet_;
    std::string name_;
    std::string node_;
    outcomes found_;
};

/// Each member has a thread, so that none waits for another that is being started.
outcomes run(const std::string& fleet, std::size_t count, const std::string& node, std::chrono::seconds span) {
    std::vector<std::unique_ptr<member>> members;
    for (std::size_t i = 0; i < count; ++i) {
        members.push_back(std::make_unique<member>(fleet, "m" + std::to_string(i), node));
    }
    std::vector<std::exception_ptr> failures(count);
    {
        std::vector<std::jthread> threads;
        const auto begin = steady::now();
        for (std::size_t i = 0; i < count; ++i) {
            const auto first = begin + between * static_cast<int>(i) / static_cast<int>(count);
            threads.emplace_back([&each = *members[i], &failure = failures[i], first, end = begin + span] {
                try {
                    each.run(first, end);
                } catch (...) {
                    failure = std::current_exception();
                }
            });
        }
    }
    for (const auto& failure : failures) {
        if (failure) {
            std::rethrow_exception(failure);
        }
    }
    outcomes all;
    for (const auto& each : members) {
        all.begun += each->found().begun;
        all.succeeded += each->found().succeeded;
        all.took.insert(all.took.end(), each->found().took.begin(), each->found().took.end());
    }
    return all;
}

} // namespace

int main(int argc, char** argv) {
    try {
        if (argc != 5) {
            std::fputs("usage: cles_member_links FLEET MEMBERS URL SECONDS\n", stderr);
            return 2;
        }
        auto found = run(argv[1], std::strtoul(argv[2], nullptr, 10), argv[3],
                         std::chrono::seconds{std::strtol(argv[4], nullptr, 10)});
        std::printf(R"({"begun":%zu,"succeeded":%zu,"p50_ms":%.3f,"p99_ms":%.3f})"
                    "\n",
                    found.begun, found.succeeded, found.quantile(0.5), found.quantile(0.99));
        return 0;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "cles_member_links: %s\n", e.what());
        return 1;
    }
}
