// SPDX-License-Identifier: BSL-1.0
#include "simulation/cluster.hpp"

#include <cles/routing.hpp>

#include "protocol/datagram.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <array>
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

} // namespace

class cluster::answer final : public cles::detail::pending {
  public:
    answer(cluster& in, std::uint32_t op) : in_(in), op_(op) {}
    verdict offer(std::string_view) override {
        in_.end_of(op_).succeeded = true;
        delete this;
        return verdict::completed;
    }
    void fail(boost::system::error_code code, std::string_view) override {
        in_.end_of(op_).code = static_cast<errc>(code.value());
        delete this;
    }
    void discard() noexcept override { delete this; }

  private:
    cluster& in_;
    std::uint32_t op_;
};

cluster::cluster(std::uint64_t seed, planted fault)
    : fault_(fault), chance_(seed), net_(time_, watcher_, chance_.next(), fault) {
    start(hub_host);
    start(client_host);
    for (const auto host : workers) {
        start(host);
    }
    time_.watch([this] { check_bounds(); });
}

cluster::~cluster() {
    time_.clear();
    for (auto& [host, n] : nodes_) {
        if (n) {
            end_run(*n);
            n.reset();
        }
    }
}

void cluster::live(seconds trouble) {
    const auto end = time_.now() + trouble;
    while (time_.now() < end) {
        ask(false);
        if (chance_.chance(20)) {
            go_wrong();
        }
        pass(std::chrono::duration_cast<milliseconds>(chance_.within(milliseconds{100})));
    }
    calm();
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
}

// -- nodes ---------------------------------------------------------------------------------------------------------

void cluster::start(unsigned host) {
    const bool is_worker = host != hub_host && host != client_host;
    const auto n =
        std::make_shared<node_run>(net_, host, ++runs_, name_of(host),
                                   node_run::options{.seed = chance_.next(),
                                                     .multicast = host != client_host,
                                                     .load = is_worker ? [this, host] { return pools_[host]->load(); }
                                                                       : std::function<node_load()>{},
                                                     .routing = host == hub_host ? cles::routing() : nullptr});
    nodes_[host] = n;
    if (is_worker) {
        pools_[host] = std::make_shared<work_pool>(*n);
        offer(*n, pools_[host]);
    }
    n->start();
}

void cluster::offer(node_run& n, const std::shared_ptr<work_pool>& pool) {
    const auto add = [&](verb v, const std::string& task, bool idempotent) {
        n.node()->tasks.add(v, task,
                            {.info = {.idempotent = idempotent},
                             .start = [this, pool](const cles::request& r, const std::shared_ptr<core::call>& c) {
                                 const auto op = r.parameter<std::uint32_t>(0);
                                 if (fault_ == planted::call_kept && kept_.empty()) {
                                     kept_.push_back(c);
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

// -- trouble -------------------------------------------------------------------------------------------------------

void cluster::end_run(node_run& n) {
    if (const auto pool = pools_.find(n.host()); pool != pools_.end()) {
        pool->second->crash();
    }
    n.crash();
}

void cluster::crash(unsigned host) {
    const auto gone = std::exchange(nodes_[host], nullptr);
    if (!gone) {
        return;
    }
    end_run(*gone);
    time_.at(time_.now() + milliseconds{chance_.between(10, 3000)}, [this, host] {
        if (!nodes_[host]) {
            start(host);
        }
    });
}

void cluster::go_wrong() {
    const auto host = chance_.chance(150) ? hub_host : workers[chance_.below(static_cast<unsigned>(workers.size()))];
    const auto n = nodes_[host];
    switch (chance_.below(6)) {
    case 0: crash(host); break;
    case 1:
        if (n) {
            n->freeze();
            time_.at(time_.now() + seconds{chance_.between(1, 8)}, [n] { n->thaw(); });
        }
        break;
    case 2:
        if (n) {
            n->jump(milliseconds{chance_.between(10, 20'000)});
        }
        break;
    case 3: net_.cut(host, chance_.below(4)); break;
    default: cut_a_way(); break;
    }
}

void cluster::cut_a_way() {
    const auto host = workers[chance_.below(static_cast<unsigned>(workers.size()))];
    const auto until = time_.now() + seconds{chance_.between(1, 8)};
    switch (chance_.below(3)) {
    case 0: net_.mute(hub_host, host, until); break;
    case 1: net_.mute(host, hub_host, until); break;
    default: net_.part(hub_host, host, until); break;
    }
}

void cluster::calm() {
    net_.calm();
    for (auto& [host, n] : nodes_) {
        if (n) {
            n->thaw();
        } else {
            start(host);
        }
    }
    pass(seconds{20});
}

// -- asking --------------------------------------------------------------------------------------------------------

void cluster::ask(bool vital) {
    static constexpr std::array<std::pair<verb, std::string_view>, 4> kinds{{{verb::delegate, "any:once"},
                                                                             {verb::delegate, "any:again"},
                                                                             {verb::pull, "any:look"},
                                                                             {verb::delegate, "all:again"}}};
    const auto op = ++last_op_;
    auto& a = asked_[op];
    const auto kind = chance_.below(4);
    const auto limit = vital ? 5000U : chance_.between(50, 3000);
    const auto long_work = chance_.chance(40) ? chance_.between(500, 4000) : chance_.below(250);
    a.deadline = time_.now() + milliseconds{limit};
    a.may_repeat = kind != 0;
    a.vital = vital;
    const auto noun =
        std::string{kinds[kind].second} + "/" + std::to_string(op) + "/" + std::to_string(vital ? 10U : long_work);
    auto& client = *nodes_[client_host];
    client.run([&] {
        client.ask(hub_host, carrier::stream,
                   {.verb = kinds[kind].first, .noun = noun, .deadline = milliseconds{limit}},
                   cles::detail::pending_ptr{new answer(*this, op)});
    });
}

cluster::asked& cluster::end_of(std::uint32_t op) {
    auto& a = asked_.at(op);
    if (++a.ends != 1) {
        watcher_.broken(rule::ends_in_time, "request " + std::to_string(op) + " ended again");
    }
    if (time_.now() > a.deadline) {
        watcher_.broken(rule::ends_in_time, "request " + std::to_string(op) + " ended after its deadline");
    }
    return a;
}

// -- judging -------------------------------------------------------------------------------------------------------

void cluster::check_bounds() {
    for (const auto& [host, n] : nodes_) {
        if (n) {
            n->check_bounds();
        }
    }
    for (const auto& [host, pool] : pools_) {
        if (nodes_[host]) {
            pool->check();
        }
    }
}

void cluster::judge_requests() {
    for (const auto& [op, a] : asked_) {
        const auto complain = [&, number = op](rule which, const std::string& what) {
            watcher_.broken(which, "request " + std::to_string(number) + " " + what);
        };
        if (a.ends == 0) {
            complain(rule::ends_in_time, "has not ended");
        }
        if (!a.may_repeat && a.ran > 1) {
            complain(rule::effects_once, "ran " + std::to_string(a.ran) + " times");
        }
        if (!a.may_repeat && a.succeeded && a.ran == 0) {
            complain(rule::replies_match, "succeeded and had not run");
        }
        if (a.vital && !a.succeeded && a.code != errc::busy) {
            complain(rule::asks_succeed, "fails though all is well");
        }
        succeeded_ += a.succeeded ? 1 : 0;
        failed_ += a.succeeded ? 0 : 1;
        refused_ += a.code == errc::busy ? 1 : 0;
    }
}

void cluster::judge_neighbours() {
    const auto& others = nodes_[hub_host]->node()->peers;
    for (const auto host : workers) {
        const auto known = others.find_member(name_of(host));
        if (!known || known->suspect || protocol::epoch_text(known->epoch) != nodes_[host]->node()->epoch) {
            watcher_.broken(rule::others_known, "the router does not know " + name_of(host) + " as it is");
        }
    }
    if (others.size() != workers.size()) {
        watcher_.broken(rule::others_known, "the router knows " + std::to_string(others.size()) + " nodes");
    }
}

void cluster::judge_rest() {
    for (const auto& [host, n] : nodes_) {
        n->check_rest();
    }
    for (const auto& [host, pool] : pools_) {
        pool->check_rest();
    }
}

} // namespace cles::simulation
