// SPDX-License-Identifier: BSL-1.0
#include "simulation/cluster.hpp"

#include <cles/routing.hpp>

#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"
#include "simulation/world/daemon_hosts.hpp"

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::simulation {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr unsigned hub_host = 0;
constexpr unsigned client_host = 4;
constexpr std::array<unsigned, 3> workers{1, 2, 3};
constexpr std::size_t most_jobs_queued = 5;
constexpr int vital_requests = 20;

std::string name_of(unsigned host) { return "car" + std::to_string(host); }

class cluster final : public daemon_hosts {
  public:
    cluster(std::uint64_t seed, planted fault, bool sharing)
        : daemon_hosts(seed, fault, most_jobs_queued), sharing_(sharing) {
        start(hub_host);
        start(client_host);
        for (const auto host : workers) {
            start(host);
        }
        time_.watch([this] {
            for (auto* n : running()) {
                check(*n);
            }
        });
    }

    work_report live(seconds trouble) {
        const auto end = time_.now() + trouble;
        while (time_.now() < end) {
            ask(false);
            if (chance_.chance(20)) {
                go_wrong();
            }
            pass(std::chrono::duration_cast<milliseconds>(chance_.within(milliseconds{100})));
        }
        end_trouble();
        pass(seconds{20});
        judge_neighbours();
        for (int i = 0; i < vital_requests; ++i) {
            ask(true);
        }
        pass(seconds{20});
        requests_.judge();
        for (auto* n : running()) {
            n->local().discovery().leave();
        }
        pass(seconds{200});
        for (auto* n : running()) {
            n->check_rest();
        }
        for (const auto host : workers) {
            pool_of(host).check_rest();
            count(*node(host));
        }
        report_.jobs = requests_.tally();
        report_.violations = watcher_.violations();
        return report_;
    }

  private:
    // -- nodes -----------------------------------------------------------------------------------------------------

    void start(unsigned host) override {
        const bool is_worker = host != hub_host && host != client_host;
        const auto n = std::make_shared<node_run>(
            net_, host, ++runs_, name_of(host),
            node_run::options{.seed = chance_.next(),
                              .multicast = host != client_host,
                              .load = is_worker ? [this, host] { return pool_of(host).load(); }
                                                : std::function<node_load()>{},
                              .routing = host == hub_host || (is_worker && sharing_) ? cles::routing() : nullptr});
        nodes_[host] = n;
        if (is_worker) {
            add_pool(*n, sharing_);
            offer(*n, verb::delegate, "once", false);
            offer(*n, verb::delegate, "again", true);
            offer(*n, verb::pull, "look", false);
        }
        n->start();
    }

    work_pool::order order_of(const request&, std::uint32_t op) override {
        return {.requester = op % 4, .heeds = op % 16 != 0};
    }

    // -- faults ----------------------------------------------------------------------------------------------------

    void go_wrong() {
        const auto host = chance_.chance(150) ? hub_host : any_worker();
        const auto action = chance_.below(6);
        if (action > 3) {
            cut_a_way();
        } else if (action == 3) {
            net_.cut(host, chance_.below(4));
        } else if (node(host) == nullptr) {
            return;
        } else if (action == 0) {
            end_node(host, milliseconds{chance_.between(10, 3000)});
        } else if (action == 1) {
            freeze(host, seconds{chance_.between(1, 8)});
        } else {
            jump(host, milliseconds{chance_.between(10, 20'000)});
        }
    }

    void cut_a_way() {
        const auto host = any_worker();
        const auto until = time_.now() + seconds{chance_.between(1, 8)};
        switch (chance_.below(3)) {
        case 0: net_.mute(hub_host, host, until); break;
        case 1: net_.mute(host, hub_host, until); break;
        default: net_.part(hub_host, host, until); break;
        }
    }

    unsigned any_worker() { return workers[chance_.below(static_cast<unsigned>(workers.size()))]; }

    // -- requests --------------------------------------------------------------------------------------------------

    void ask(bool vital) {
        static constexpr std::array<std::pair<verb, std::string_view>, 4> kinds{{{verb::delegate, "any:once"},
                                                                                 {verb::delegate, "any:again"},
                                                                                 {verb::pull, "any:look"},
                                                                                 {verb::delegate, "all:again"}}};
        const auto kind = chance_.below(4);
        const milliseconds limit{vital ? 5000U : chance_.between(50, 3000)};
        const auto long_work = chance_.chance(40) ? chance_.between(500, 4000) : chance_.below(250);
        const auto op = requests_.add({.most_runs = kind == 0 ? 1 : ledger::any_number,
                                       .vital = vital,
                                       .may_be_refused = true,
                                       .deadline = time_.now() + limit});
        const auto noun =
            std::string{kinds[kind].second} + "/" + std::to_string(op) + "/" + std::to_string(vital ? 10U : long_work);
        auto& client = *node(client_host);
        client.run([&] {
            client.ask(hub_host, carrier::stream, {.verb = kinds[kind].first, .noun = noun, .deadline = limit},
                       requests_.operation(op));
        });
    }

    // -- checks ----------------------------------------------------------------------------------------------------

    void judge_neighbours() {
        const auto& others = node(hub_host)->node()->peers;
        for (const auto host : workers) {
            const auto known = others.find_member(name_of(host));
            if (!known || known->suspect || protocol::epoch_text(known->epoch) != node(host)->node()->epoch) {
                watcher_.broken(rule::others_known, "the router does not know " + name_of(host) + " as it is");
            }
        }
        if (others.size() != workers.size()) {
            watcher_.broken(rule::others_known, "the router knows " + std::to_string(others.size()) + " nodes");
        }
    }

    const bool sharing_;
    unsigned runs_ = 0;
};

} // namespace

work_report simulate_cluster(std::uint64_t seed, seconds trouble, planted fault, bool sharing) {
    return cluster{seed, fault, sharing}.live(trouble);
}

} // namespace cles::simulation
