// SPDX-License-Identifier: BSL-1.0
#include "simulation/sharing_speed.hpp"

#include <cles/gossip.hpp>
#include <cles/routing.hpp>

#include "simulation/world/daemon_hosts.hpp"

#include <array>
#include <iomanip>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <utility>

namespace cles::simulation {
namespace {

class burst final : public daemon_hosts {
    using microseconds = std::chrono::microseconds;
    using milliseconds = std::chrono::milliseconds;

    static constexpr unsigned queue_host = 0; // the node to which the jobs are submitted
    static constexpr unsigned other_host = 1;
    static constexpr unsigned client_host = 2;
    static constexpr std::array<const char*, 3> names{"queue", "other", "client"};
    static constexpr milliseconds until_found{1'500};
    static constexpr milliseconds job_deadline{600'000};
    // One way, between two hosts of a local network.
    static constexpr weather local_network{.least = microseconds{30}, .spread = microseconds{60}};

  public:
    burst(std::uint64_t seed, const shared_burst& setup)
        : daemon_hosts(seed, planted::none, setup.jobs + 1), setup_(setup) {
        net_.set(local_network);
        for (const auto host : {queue_host, other_host, client_host}) {
            start(host);
        }
        time_.watch([this] {
            for (auto* n : running()) {
                check(*n);
            }
        });
    }

    burst_report live() {
        pass(until_found);
        if (setup_.before.count() != 0) {
            submit(other_host, setup_.kinds.front().task, setup_.before);
            pass(setup_.before + until_found);
        }
        burst_report report;
        const auto begun = time_.now();
        const auto idle_before = idle_.total();
        std::vector<shared_burst::kind> jobs;
        for (unsigned i = 0; i < setup_.jobs; ++i) {
            jobs.push_back(setup_.kinds[i % setup_.kinds.size()]);
        }
        for (auto left = setup_.jobs; left > 1; --left) {
            std::swap(jobs[left - 1], jobs[chance_.below(left)]);
        }
        for (const auto& each : jobs) {
            submit(queue_host, each.task, each.work);
            report.work += in_seconds(each.work);
        }
        while (open_ != 0 && time_.now() < begun + job_deadline) {
            pass(milliseconds{1});
        }
        report.seconds = in_seconds(time_.now() - begun);
        report.idle_seconds = (idle_.total() - idle_before).count();
        report.ideal = report.work / static_cast<double>(setup_.workers + setup_.other_workers);
        report.moved = pool_of(queue_host).sent() - pool_of(queue_host).returned();
        report.returned = pool_of(queue_host).returned();
        requests_.judge();
        report.violations = watcher_.violations();
        return report;
    }

  private:
    static double in_seconds(std::chrono::nanoseconds span) { return std::chrono::duration<double>(span).count(); }

    void start(unsigned host) override {
        node_run::options how{.seed = chance_.next()};
        if (host != client_host) {
            const auto other = host == queue_host ? other_host : queue_host;
            how.load = [this, host] { return pool_of(host).load(); };
            how.routing = cles::routing();
            how.gossip = cles::gossip({net_.url_of(other, carrier::stream)}, {names.at(other)});
        }
        const auto n = std::make_shared<node_run>(net_, host, 1, names.at(host), std::move(how));
        nodes_[host] = n;
        if (host != client_host) {
            add_pool(*n, true,
                     {.workers = host == queue_host ? setup_.workers : setup_.other_workers,
                      .most_queued = setup_.jobs,
                      .lingers = true});
            std::set<std::string> tasks;
            for (const auto& each : setup_.kinds) {
                if (tasks.insert(each.task).second) {
                    offer(*n, verb::delegate, each.task, false);
                }
            }
        }
        n->start();
    }

    work_pool::order order_of(const request& r, std::uint32_t) override {
        return {.requester = 1, .body = std::string{r.body()}};
    }

    void submit(unsigned host, const std::string& task, milliseconds work) {
        const auto op = requests_.add({.vital = true, .deadline = time_.now() + job_deadline});
        const auto noun =
            std::string{names.at(host)} + ":" + task + "/" + std::to_string(op) + "/" + std::to_string(work.count());
        ++open_;
        node(client_host)
            ->ask(host, carrier::stream, {.verb = verb::delegate, .noun = noun, .body = "{}", .deadline = job_deadline},
                  requests_.operation(op, [this] { --open_; }));
    }

    const shared_burst setup_;
    unsigned open_ = 0; // jobs without a reply
};

} // namespace

std::string to_text(const burst_report& r) {
    std::ostringstream out;
    out << std::fixed << std::setprecision(3) << r.seconds << " s, ideally " << r.ideal << " s; workers were idle for "
        << r.idle_seconds << " s while jobs waited, for " << r.work << " s of work; " << r.moved << " moved, "
        << r.returned << " returned";
    return out.str();
}

burst_report simulate_burst(std::uint64_t seed, const shared_burst& setup) { return burst{seed, setup}.live(); }

} // namespace cles::simulation
