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
#include <boost/asio/steady_timer.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <string>
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

/// A member that has just been started.
class member_node : public std::enable_shared_from_this<member_node> {
  public:
    member_node(boost::asio::io_context& io, const std::string& fleet, const std::string& name, const std::string& node)
        : service_(io, options_of(fleet, name, node)) {}

    void ask(outcomes& into) {
        ++into.begun;
        const auto begun = steady::now();
        service_.async_pull(
            "node:cles", cles::call_options{}.deadline(longest),
            [self = shared_from_this(), &into, begun](boost::system::error_code code, const cles::json_text&) {
                into.succeeded += code ? 0U : 1U;
                into.took.push_back(code ? std::chrono::nanoseconds{longest} : steady::now() - begun);
            });
    }

  private:
    static cles::service_options options_of(const std::string& fleet, const std::string& name,
                                            const std::string& node) {
        cles::service_options made{.name = name};
        made.peers.emplace("node", node);
        made.security = cles::secured(fleet + "/" + name);
        return made;
    }

    cles::service service_;
};

class started_members {
  public:
    started_members(std::string fleet, std::size_t members, std::string node, std::chrono::seconds span)
        : fleet_(std::move(fleet)), node_(std::move(node)), end_(steady::now() + span) {
        for (std::size_t i = 0; i < members; ++i) {
            timers_.push_back(std::make_unique<boost::asio::steady_timer>(io_));
            wait(i, steady::now() + between * static_cast<int>(i) / static_cast<int>(members));
        }
    }

    outcomes run() {
        io_.run();
        return std::move(found_);
    }

  private:
    void wait(std::size_t member, steady::time_point until) {
        timers_[member]->expires_at(until);
        timers_[member]->async_wait([this, member, until](boost::system::error_code) {
            std::make_shared<member_node>(io_, fleet_, "m" + std::to_string(member), node_)->ask(found_);
            if (until + between < end_) {
                wait(member, until + between);
            }
        });
    }

    std::string fleet_;
    std::string node_;
    steady::time_point end_;
    boost::asio::io_context io_{1};
    std::vector<std::unique_ptr<boost::asio::steady_timer>> timers_;
    outcomes found_;
};

} // namespace

int main(int argc, char** argv) {
    try {
        if (argc != 5) {
            std::fputs("usage: cles_member_links FLEET MEMBERS URL SECONDS\n", stderr);
            return 2;
        }
        started_members all{argv[1], std::strtoul(argv[2], nullptr, 10), argv[3],
                            std::chrono::seconds{std::strtol(argv[4], nullptr, 10)}};
        auto found = all.run();
        std::printf(R"({"begun":%zu,"succeeded":%zu,"p50_ms":%.3f,"p99_ms":%.3f})"
                    "\n",
                    found.begun, found.succeeded, found.quantile(0.5), found.quantile(0.99));
        return 0;
    } catch (const std::exception& e) {
        std::fprintf(stderr, "cles_member_links: %s\n", e.what());
        return 1;
    }
}
