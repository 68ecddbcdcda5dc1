// SPDX-License-Identifier: BSL-1.0
#include "simulation/cluster.hpp"

#include "core/ignored_reply.hpp"

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
unsigned host_of(std::string_view name) { return static_cast<unsigned>(name.back() - '0'); }

} // namespace

/// The router's ways to the others.
class cluster::ways final : public core::onward {
  public:
    explicit ways(node_run& hub) : hub_(hub) {}

    std::uint64_t send(const request& r, cles::detail::pending_ptr reply,
                       core::outbound::progress_function progress) override {
        const auto noun = std::string{r.node}.append(":").append(r.path);
        const auto put = [&](cles::detail::pending_ptr to, core::outbound::progress_function tells) {
            return hub_.ask(
                host_of(r.node), carrier::stream,
                {.verb = r.verb, .noun = noun, .body = r.body, .deadline = r.deadline, .adverbs = r.adverbs},
                std::move(to), std::move(tells));
        };
        if (hub_.fault() == planted::way_repeats) {
            put(cles::detail::pending_ptr{new core::ignored_reply}, {});
        }
        return put(std::move(reply), std::move(progress));
    }
    void withdraw(std::uint64_t ticket) override { hub_.cancel(ticket); }
    std::uint64_t bind(std::string_view, std::string_view, std::string_view, core::feed_events&) override { return 0; }
    void unbind(std::uint64_t) override {}

  private:
    node_run& hub_;
};

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
    routing_->stop();
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
    silent_ = true;
    pass(seconds{200});
    judge_rest();
}

// -- nodes ---------------------------------------------------------------------------------------------------------

void cluster::start(unsigned host) {
    core::node_setup setup{.name = name_of(host), .epoch = static_cast<std::uint32_t>(chance_.next())};
    const auto n = std::make_shared<node_run>(net_, host, ++runs_, std::move(setup));
    nodes_[host] = n;
    if (host == hub_host) {
        start_routing();
    } else if (host != client_host) {
        pools_[host] = std::make_shared<work_pool>(*n);
        offer(*n, pools_[host]);
        announce(host, runs_, 1);
    }
    n->start(false);
}

void cluster::start_routing() {
    auto& hub = *nodes_[hub_host];
    ways_.push_back(std::make_unique<ways>(hub));
    // What is ready to begin does so in a turn of the hub.
    const auto wake = [this, weak = std::weak_ptr{nodes_[hub_host]}] {
        if (const auto n = weak.lock()) {
            n->later({}, [this, n = n.get()] { routing_->begin_ready(n->now()); });
        }
    };
    routing_ = std::make_shared<core::routing>(hub.node(), *ways_.back(), hub.run_number() * 7U, wake);
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

// What the multicast group does elsewhere.
void cluster::announce(unsigned host, unsigned run, std::uint64_t seq) {
    const auto n = nodes_[host];
    constexpr std::uint64_t enough = 20;
    const bool ends = fault_ == planted::announcements_end && host == workers[0] && seq > enough;
    if (!n || n->run_number() != run || silent_ || ends) {
        return;
    }
    n->later(seconds{1}, [this, host, run, seq] { announce(host, run, seq + 1); });
    if (const auto hub = nodes_[hub_host]; hub && net_.reaches(host, hub_host)) {
        core::group_source from;
        from.address = 0x7f000001;
        from.port = static_cast<std::uint16_t>(1000 + host);
        const core::announcement said{.node = n->name(),
                                      .endpoints = {"tcp://127.0.0.1:1"},
                                      .load = pools_[host]->load(),
                                      .interval = seconds{1},
                                      .tasks = "same"};
        hub->run([to = hub.get(), said, run, seq, from] { to->node()->others.hear(said, run, seq, from, to->now()); });
    }
}

// -- trouble -------------------------------------------------------------------------------------------------------

void cluster::end_run(node_run& n) {
    n.crash();
    if (const auto pool = pools_.find(n.host()); pool != pools_.end()) {
        pool->second->crash();
    }
}

void cluster::crash(unsigned host) {
    const auto gone = std::exchange(nodes_[host], nullptr);
    if (!gone) {
        return;
    }
    end_run(*gone);
    if (host == hub_host) {
        routing_->stop();
    }
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
        client.ask(hub_host, carrier::stream, {.verb = kinds[kind].first, .noun = noun, .deadline = a.deadline},
                   cles::detail::pending_ptr{new answer(*this, op)}, {});
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
    const auto& others = nodes_[hub_host]->node()->others;
    for (const auto host : workers) {
        const auto known = others.look(name_of(host));
        if (!known || known->suspect || known->epoch != nodes_[host]->run_number()) {
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
