// SPDX-License-Identifier: BSL-1.0
#include "simulation/cluster.hpp"

#include <cles/routing.hpp>

#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"
#include "simulation/world/node_hosts.hpp"
#include "simulation/world/work_pool.hpp"

#include <array>
#include <map>
#include <memory>
#include <string>
#include <utility>

namespace cles::simulation {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr unsigned hub_host = 0;
constexpr unsigned client_host = 4;
constexpr std::array<unsigned, 3> workers{1, 2, 3};
constexpr int vital_requests = 20;

std::string name_of(unsigned host) { return "car" + std::to_string(host); }

class cluster final : public node_hosts {
  public:
    cluster(std::uint64_t seed, planted fault, bool sharing) : node_hosts(seed, fault), sharing_(sharing) {
        start(hub_host);
        start(client_host);
        for (const auto host : workers) {
            start(host);
        }
        time_.watch([this] { check_bounds(); });
    }
    cluster(const cluster&) = delete;
    cluster& operator=(const cluster&) = delete;
    ~cluster() { end_all(); }

    cluster_report live(seconds trouble) {
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
        judge_requests();
        for (const auto& [host, n] : nodes_) {
            n->local().discovery().leave();
        }
        pass(seconds{200});
        judge_rest();
        report_.violations = watcher_.violations();
        return report_;
    }

  private:
    struct asked {
        std::uint32_t op = 0;
        bool may_repeat = false;
        bool vital = false; ///< has to succeed, or to be refused because all are busy
        time_point deadline{};
        int ends = 0;
        bool succeeded = false;
        errc code{};
        int ran = 0; ///< the number of executions, on any node
    };

    // -- nodes -----------------------------------------------------------------------------------------------------

    void start(unsigned host) override {
        const bool is_worker = host != hub_host && host != client_host;
        const auto n = std::make_shared<node_run>(
            net_, host, ++runs_, name_of(host),
            node_run::options{.seed = chance_.next(),
                              .multicast = host != client_host,
                              .load = is_worker ? [this, host] { return pools_[host]->load(); }
                                                : std::function<node_load()>{},
                              .routing = host == hub_host || (is_worker && sharing_) ? cles::routing() : nullptr});
        nodes_[host] = n;
        if (is_worker) {
            pools_[host] = std::make_shared<work_pool>(*n);
            if (sharing_) {
                pools_[host]->share();
            }
            offer(*n, pools_[host]);
        }
        n->start();
    }

    void offer(node_run& n, const std::shared_ptr<work_pool>& pool) {
        const auto add = [&](verb v, const std::string& task, bool idempotent) {
            n.node()->tasks.add(v, task,
                                {.info = {.idempotent = idempotent},
                                 .start = [this, pool](const request& r, const std::shared_ptr<core::call>& c) {
                                     const auto op = r.parameter<std::uint32_t>(0);
                                     if (fault() == planted::call_kept && kept_ == nullptr) {
                                         kept_ = c;
                                     }
                                     pool->submit({.requester = op % 4,
                                                   .answer = c,
                                                   .work = milliseconds{r.parameter<unsigned>(1)},
                                                   .heeds = op % 16 != 0,
                                                   .begun = [this, op] { ++asked_.at(op).ran; }});
                                 }});
        };
        add(verb::delegate, "once", false);
        add(verb::delegate, "again", true);
        add(verb::pull, "look", false);
    }

    void end_run(node_run& n) override {
        if (const auto pool = pools_.find(n.host()); pool != pools_.end()) {
            report_.moved += pool->second->sent() - pool->second->returned();
            pool->second->crash();
        }
        n.crash();
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
        const auto op = ++last_op_;
        auto& a = asked_[op];
        const auto kind = chance_.below(4);
        const auto limit = vital ? 5000U : chance_.between(50, 3000);
        const auto long_work = chance_.chance(40) ? chance_.between(500, 4000) : chance_.below(250);
        a.op = op;
        a.deadline = time_.now() + milliseconds{limit};
        a.may_repeat = kind != 0;
        a.vital = vital;
        const auto noun =
            std::string{kinds[kind].second} + "/" + std::to_string(op) + "/" + std::to_string(vital ? 10U : long_work);
        auto& client = *node(client_host);
        client.run([&] {
            client.ask(hub_host, carrier::stream,
                       {.verb = kinds[kind].first, .noun = noun, .deadline = milliseconds{limit}},
                       when_ended([this, &a](std::string_view) { end(a).succeeded = true; },
                                  [this, &a](errc code, std::string_view) { end(a).code = code; }));
        });
    }

    asked& end(asked& a) {
        if (++a.ends != 1) {
            complain(rule::ends_in_time, a, "ended again");
        }
        if (time_.now() > a.deadline) {
            complain(rule::ends_in_time, a, "ended after its deadline");
        }
        return a;
    }

    // -- checks ----------------------------------------------------------------------------------------------------

    void complain(rule which, const asked& a, const std::string& what) {
        watcher_.broken(which, "request " + std::to_string(a.op) + " " + what);
    }

    void check_bounds() {
        for (const auto& [host, n] : nodes_) {
            if (n) {
                n->check_bounds();
            }
        }
        for (const auto& [host, pool] : pools_) {
            if (node(host) != nullptr) {
                pool->check();
            }
        }
    }

    void judge_requests() {
        for (const auto& [op, a] : asked_) {
            if (a.ends == 0) {
                complain(rule::ends_in_time, a, "has not ended");
            }
            if (!a.may_repeat && a.ran > 1) {
                complain(rule::effects_once, a, "ran " + std::to_string(a.ran) + " times");
            }
            if (!a.may_repeat && a.succeeded && a.ran == 0) {
                complain(rule::replies_match, a, "succeeded and had not run");
            }
            if (a.vital && !a.succeeded && a.code != errc::busy) {
                complain(rule::asks_succeed, a, "fails though all is well");
            }
            ++(a.succeeded ? report_.succeeded : report_.failed);
            report_.refused += a.code == errc::busy ? 1 : 0;
        }
    }

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

    void judge_rest() {
        for (const auto& [host, n] : nodes_) {
            n->check_rest();
        }
        for (const auto& [host, pool] : pools_) {
            pool->check_rest();
            report_.moved += pool->sent() - pool->returned();
        }
    }

    const bool sharing_;
    std::map<unsigned, std::shared_ptr<work_pool>> pools_;
    std::map<std::uint32_t, asked> asked_;
    std::shared_ptr<core::call> kept_; // by a planted fault
    std::uint32_t last_op_ = 0;
    unsigned runs_ = 0;
    cluster_report report_;
};

} // namespace

cluster_report simulate_cluster(std::uint64_t seed, seconds trouble, planted fault, bool sharing) {
    return cluster{seed, fault, sharing}.live(trouble);
}

} // namespace cles::simulation
