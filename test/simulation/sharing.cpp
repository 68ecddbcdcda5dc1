// SPDX-License-Identifier: BSL-1.0
#include "simulation/sharing.hpp"

#include <cles/gossip.hpp>
#include <cles/routing.hpp>

#include "node/membership/gossip.hpp"
#include "simulation/network/graph.hpp"
#include "simulation/world/node_hosts.hpp"
#include "simulation/world/work_pool.hpp"

#include <algorithm>
#include <chrono>
#include <memory>
#include <set>
#include <utility>

namespace cles::simulation {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr unsigned jobs_per_second = 60; // per node, so that most nodes are idle
constexpr unsigned most_in_burst = 24;
constexpr std::size_t most_queued = 64; // of each node
constexpr unsigned vital_bursts = 50;
constexpr unsigned vital_burst = 16;
constexpr milliseconds vital_deadline{2000};
constexpr milliseconds until_found{1500}; // the nodes, and then the routes
constexpr milliseconds until_ended{5000}; // longer than any job takes
constexpr milliseconds drain_limit{1000};
constexpr milliseconds close_limit{500};

class sharing_mesh final : public node_hosts {
  public:
    sharing_mesh(std::uint64_t seed, const sharing_setup& setup, planted fault)
        : node_hosts(seed, fault), setup_(setup),
          links_(graph::of(mesh_form::random, setup.nodes, setup.mean_degree, chance_)) {
        for (unsigned host = 0; host < setup.nodes; ++host) {
            start(host);
        }
        for (unsigned i = 0; i < std::max(1U, setup.nodes / 10); ++i) {
            busy_.push_back(any_host());
        }
        for (unsigned i = 0; i < setup.clients; ++i) {
            clients_.push_back({.entry = chance_.chance(500) ? any_busy() : any_host(),
                                .by = chance_.chance(250) ? carrier::datagram : carrier::stream});
            if (clients_.back().by == carrier::datagram) {
                steady_.insert(clients_.back().entry);
            }
            start(setup.nodes + i);
        }
        time_.watch([this] {
            const auto host = static_cast<unsigned>(time_.steps() / 64 % setup_.nodes);
            if (node(host) != nullptr) {
                node(host)->check_bounds();
                pools_.at(host)->check();
            }
        });
    }
    sharing_mesh(const sharing_mesh&) = delete;
    sharing_mesh& operator=(const sharing_mesh&) = delete;
    ~sharing_mesh() { end_all(); }

    sharing_report live() {
        const auto begun = time_.now();
        pass(until_found);
        if (setup_.faults_per_minute != 0) {
            net_.set({.lost = 5, .doubled = 5, .late = 5});
            time_.at(time_.now(), [this] { go_wrong(); });
        }
        for (bool whole = true; jobs_.size() < setup_.jobs;) {
            const auto burst = chance_.chance(200) ? chance_.between(2, most_in_burst) : 1;
            submit_burst(burst, false);
            time_.run_until(time_.now() + burst * microseconds{1'000'000 / (jobs_per_second * setup_.nodes)});
            if (setup_.faults_per_minute != 0 && whole && jobs_.size() > setup_.jobs / 2) {
                whole = false;
                cut_in_two();
            }
        }
        over_ = true;
        end_trouble();
        pass(until_ended);
        pass_until_routes();
        for (unsigned i = 0; i < vital_bursts; ++i) {
            submit_burst(vital_burst, true);
            pass(milliseconds{30});
        }
        pass(vital_deadline + seconds{1});
        judge_jobs();
        judge_rest();
        report_.seconds = std::chrono::duration<double>(time_.now() - begun).count();
        report_.violations = watcher_.violations();
        return report_;
    }

  private:
    struct client {
        unsigned entry = 0;
        carrier by = carrier::stream;
    };
    struct job {
        bool vital = false;      ///< has to succeed
        bool may_repeat = false; ///< a node that chooses may repeat it once
        time_point deadline{};
        int ends = 0;
        bool succeeded = false;
        errc code{};
        int ran = 0; ///< the number of executions, on any node
        std::string why{};
    };

    // -- nodes -----------------------------------------------------------------------------------------------------

    void start(unsigned host) override {
        const bool is_client = host >= setup_.nodes;
        node_run::options how{.seed = chance_.next()};
        if (!is_client) {
            std::vector<std::string> seeds;
            std::vector<std::string> names;
            for (const auto other : links_.of(host)) {
                seeds.push_back(net_.url_of(other, carrier::stream));
                names.push_back(mesh_name(other));
            }
            how.load = [this, host] { return pools_.at(host)->load(); };
            how.routing = cles::routing();
            how.gossip = cles::gossip(seeds, names);
        }
        const auto n = std::make_shared<node_run>(
            net_, host, ++runs_[host], is_client ? "client" + std::to_string(host) : mesh_name(host), std::move(how));
        nodes_[host] = n;
        if (!is_client) {
            const auto pool = std::make_shared<work_pool>(*n, most_queued);
            pools_[host] = pool;
            pool->share();
            offer(*n, pool, "once", false);
            offer(*n, pool, "again", true);
        }
        n->start();
    }

    void offer(node_run& n, const std::shared_ptr<work_pool>& pool, const char* task, bool idempotent) {
        n.node()->tasks.add(verb::delegate, task,
                            {.info = {.idempotent = idempotent},
                             .start = [this, pool](const request& r, const std::shared_ptr<core::call>& c) {
                                 const auto op = r.parameter<std::uint32_t>(0);
                                 if (r.body() != body_of(op)) {
                                     complain(rule::replies_match, op, "came with the body of another");
                                 }
                                 pool->submit({.requester = r.parameter<std::uint64_t>(2),
                                               .answer = c,
                                               .work = milliseconds{r.parameter<unsigned>(1)},
                                               .heeds = op % 64 != 0,
                                               .body = std::string{r.body()},
                                               .begun = [this, op] { ++jobs_.at(op).ran; }});
                             }});
    }

    void end_run(node_run& n) override {
        if (const auto pool = pools_.find(n.host()); pool != pools_.end()) {
            count(n, *pool->second);
            pool->second->crash();
        }
        n.crash();
    }

    void count(node_run& n, const work_pool& pool) {
        report_.moved += pool.sent() - pool.returned();
        report_.returned += pool.returned();
        report_.grants += n.node()->counts.grants_sent;
    }

    // -- faults ----------------------------------------------------------------------------------------------------

    void go_wrong() {
        if (over_) {
            return;
        }
        ++report_.faults;
        // Many of them where the work is.
        const auto host = chance_.chance(300) ? any_busy() : any_host();
        const auto span = milliseconds{chance_.between(20, 1500)};
        const bool runs = node(host) != nullptr;
        switch (chance_.below(8)) {
        case 0:
            if (!steady_.contains(host)) {
                end_node(host, span);
            }
            break;
        case 1: stop_in_order(host, span); break;
        case 2:
            if (runs) {
                net_.cut(host, chance_.below(8));
            }
            break;
        case 3: net_.cut(setup_.nodes + chance_.below(setup_.clients), 0); break;
        case 4: net_.part(host, any_neighbour(host), time_.now() + span); break;
        case 5: net_.mute(host, any_neighbour(host), time_.now() + span); break;
        case 6: freeze(host, span); break;
        default: jump(host, span);
        }
        time_.at(time_.now() + chance_.within(microseconds{120'000'000} / (setup_.faults_per_minute * setup_.nodes)),
                 [this] { go_wrong(); });
    }

    void stop_in_order(unsigned host, milliseconds down) {
        auto* n = node(host);
        if (n == nullptr || n->frozen() || pools_.at(host)->draining() || steady_.contains(host)) {
            return;
        }
        watcher_.saw(n->name(), "leaves in order");
        n->local().discovery().leave();
        const auto end = [this, host, down, run = runs_[host]] {
            if (node(host) != nullptr && runs_[host] == run) {
                time_.at(time_.now(), [this, host, down] { end_node(host, down); });
            }
        };
        pools_.at(host)->drain(
            drain_limit, [n, end] { n->local().close(close_limit, when_ended([end](std::string_view) { end(); })); });
    }

    // The nodes with smaller numbers cannot reach the others.
    void cut_in_two() {
        const auto until = time_.now() + milliseconds{chance_.between(200, 2000)};
        for (unsigned a = 0; a < setup_.nodes / 2; ++a) {
            for (const auto b : links_.of(a)) {
                if (b >= setup_.nodes / 2) {
                    net_.part(a, b, until);
                }
            }
        }
    }

    // Until each node has a route to each other.
    void pass_until_routes() {
        const auto limit = time_.now() + seconds{60};
        while (const auto missing = missing_routes()) {
            if (time_.now() > limit) {
                watcher_.broken(rule::routes_found, std::to_string(missing) + " routes are missing");
                return;
            }
            pass(milliseconds{250});
        }
    }

    std::size_t missing_routes() {
        std::size_t missing = 0;
        for (unsigned host = 0; host < setup_.nodes; ++host) {
            const auto& routes = node(host)->node()->gossip_responder->reach();
            for (unsigned other = 0; other < setup_.nodes; ++other) {
                missing += other == host || routes.hops_to(mesh_name(other)) ? 0 : 1;
            }
        }
        return missing;
    }

    unsigned any_host() { return chance_.below(setup_.nodes); }
    unsigned any_busy() { return busy_[chance_.below(chance_.between(1, static_cast<unsigned>(busy_.size())))]; }
    unsigned any_neighbour(unsigned host) {
        const auto& all = links_.of(host);
        return *std::next(all.begin(), chance_.below(static_cast<unsigned>(all.size())));
    }

    // -- jobs ------------------------------------------------------------------------------------------------------

    static std::string body_of(std::uint32_t op) { return "{\"op\":" + std::to_string(op) + "}"; }

    std::string any_target(unsigned by) {
        return chance_.chance(250)   ? "any"
               : chance_.chance(600) ? mesh_name(clients_[by].entry)
               : chance_.chance(700) ? mesh_name(any_busy())
                                     : mesh_name(any_host());
    }

    void submit_burst(unsigned count, bool vital) {
        const auto by = chance_.below(setup_.clients);
        const auto target = any_target(by);
        for (unsigned i = 0; i < count; ++i) {
            submit(by, target, vital);
        }
    }

    void submit(unsigned by_client, const std::string& target, bool vital) {
        const auto op = static_cast<std::uint32_t>(jobs_.size());
        const bool again = chance_.chance(500);
        const auto work = vital ? 10U : chance_.chance(2) ? chance_.between(200, 2000) : chance_.between(1, 24);
        const auto limit = vital ? vital_deadline : milliseconds{chance_.between(50, 4000)};
        jobs_.push_back({.vital = vital, .may_repeat = again && target == "any", .deadline = time_.now() + limit});
        const auto noun = target + (again ? ":again/" : ":once/") + std::to_string(op) + "/" + std::to_string(work) +
                          "/" + std::to_string(by_client);
        const auto& [entry, by] = clients_[by_client];
        auto& n = *node(setup_.nodes + by_client);
        const auto ticket =
            n.ask(entry, by, {.verb = verb::delegate, .noun = noun, .body = body_of(op), .deadline = limit},
                  when_ended([this, op](std::string_view) { end(op).succeeded = true; },
                             [this, op](errc code, std::string_view why) {
                                 end(op).code = code;
                                 jobs_[op].why = why;
                             }));
        if (!vital && chance_.chance(30)) {
            n.later(chance_.within(milliseconds{100}), [&n, ticket] { n.cancel(ticket); });
        }
    }

    job& end(std::uint32_t op) {
        auto& j = jobs_[op];
        if (++j.ends != 1) {
            complain(rule::ends_in_time, op, "ended again");
        }
        if (time_.now() > j.deadline) {
            complain(rule::ends_in_time, op, "ended after its deadline");
        }
        return j;
    }

    // -- checks ----------------------------------------------------------------------------------------------------

    void complain(rule which, std::uint32_t op, const std::string& what) {
        watcher_.broken(which, "job " + std::to_string(op) + " " + what);
    }

    // Whether the reply says that the job has not run.
    static bool denies_run(errc code) {
        return code == errc::busy || code == errc::no_target || code == errc::no_task || code == errc::denied ||
               code == errc::bad_request;
    }

    void judge_jobs() {
        report_.jobs = jobs_.size();
        for (std::uint32_t op = 0; op < jobs_.size(); ++op) {
            const auto& j = jobs_[op];
            if (j.ends == 0) {
                complain(rule::ends_in_time, op, "has not ended");
            }
            if (j.ran > (j.may_repeat ? 2 : 1)) {
                complain(rule::effects_once, op, "ran " + std::to_string(j.ran) + " times");
            }
            if (j.succeeded && j.ran == 0) {
                complain(rule::replies_match, op, "succeeded and had not run");
            }
            if (!j.succeeded && denies_run(j.code) && j.ran != 0) {
                complain(rule::replies_match, op, "ran, and was refused: " + j.why);
            }
            if (j.vital && !j.succeeded) {
                complain(rule::asks_succeed, op, "fails though all is well: " + j.why);
            }
            if (j.succeeded) {
                ++report_.succeeded;
            } else {
                ++report_.failed[std::string{wire_name(j.code)}];
            }
        }
    }

    // Nodes that gossip are never at rest, but nothing is left of the jobs, and nobody grants anything.
    void judge_rest() {
        std::map<unsigned, std::uint64_t> grants;
        for (unsigned host = 0; host < setup_.nodes; ++host) {
            auto& n = *node(host);
            const auto& counts = n.node()->counts;
            grants[host] = counts.grants_sent;
            if (counts.handlers_running != 0 || counts.routed != 0) {
                watcher_.broken(rule::at_rest, n.name() + ": " + std::to_string(counts.handlers_running) +
                                                   " handlers that run and " + std::to_string(counts.routed) +
                                                   " requests that other nodes serve");
            }
            pools_.at(host)->check_rest();
            count(n, *pools_.at(host));
        }
        pass(seconds{2});
        for (const auto& [host, sent] : grants) {
            if (node(host)->node()->counts.grants_sent != sent) {
                watcher_.broken(rule::at_rest, node(host)->name() + " grants slots though there are no jobs");
            }
        }
    }

    const sharing_setup setup_;
    const graph links_;
    std::vector<unsigned> busy_; // the hosts to which most jobs are submitted, the busiest first
    std::vector<client> clients_;
    // Hosts to which clients send datagrams. They run on: one that restarts cannot know which requests it has served.
    std::set<unsigned> steady_;
    std::map<unsigned, std::shared_ptr<work_pool>> pools_;
    std::map<unsigned, unsigned> runs_;
    std::vector<job> jobs_;
    bool over_ = false; // nothing goes wrong any more
    sharing_report report_;
};

} // namespace

sharing_report simulate_sharing(std::uint64_t seed, const sharing_setup& setup, planted fault) {
    return sharing_mesh{seed, setup, fault}.live();
}

} // namespace cles::simulation
