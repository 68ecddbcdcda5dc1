// SPDX-License-Identifier: BSL-1.0
#include "simulation/world/world.hpp"

#include "simulation/workload/asking.hpp"
#include "simulation/workload/following.hpp"
#include "simulation/workload/multicasting.hpp"
#include "simulation/workload/neighbouring.hpp"
#include "simulation/workload/talking.hpp"
#include "simulation/workload/trouble.hpp"

#include <algorithm>
#include <utility>

namespace cles::simulation {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr seconds memory_of_datagrams{75}; // and some more: then what was remembered is forgotten
constexpr seconds probing{10};
constexpr seconds quiet{300};

limits small_limits() {
    limits bounds;
    bounds.line = 2048;
    bounds.links = 64;
    bounds.in_flight = 24;
    bounds.bindings = 8;
    bounds.running = 40;
    bounds.unread = 8192;
    bounds.waiting = 4096;
    bounds.binding_bytes = 16384;
    bounds.remembered = 40'000;
    bounds.feed = 16;
    bounds.stall = seconds{5};
    bounds.lease = seconds{3};
    bounds.connect = seconds{2};
    return bounds;
}

/// Waits until a node has left in order.
class end_of_departure final : public detail::pending {
  public:
    explicit end_of_departure(std::function<void()> then) : then_(std::move(then)) {}
    verdict offer(std::string_view) override {
        const std::unique_ptr<end_of_departure> self{this};
        then_();
        return verdict::completed;
    }
    void fail(boost::system::error_code, std::string_view) override { delete this; }
    void discard() noexcept override { delete this; }

  private:
    std::function<void()> then_;
};

// What must never be: something that outlives a world.
std::uint64_t leak(planted fault) {
    static std::uint64_t leaked = 0;
    return fault == planted::chance_leaks ? ++leaked : 0;
}

} // namespace

bool report::broke(rule which) const noexcept {
    return std::any_of(violations.begin(), violations.end(), [which](const auto& v) { return v.broken == which; });
}

world::world(const plan& what, planted fault, witness::reader reader)
    : plan_(what), fault_(fault), chance_(what.seed + leak(fault)), net_(time_, watcher_, chance_.next(), fault),
      nodes_(what.hosts), runs_(what.hosts) {
    watcher_.read_by(std::move(reader));
    parts_.push_back(std::make_unique<asking>(*this));
    auto feeds = std::make_unique<following>(*this);
    const auto& published = *feeds;
    parts_.push_back(std::move(feeds));
    parts_.push_back(std::make_unique<multicasting>(*this, published));
    parts_.push_back(std::make_unique<talking>(*this));
    parts_.push_back(std::make_unique<neighbouring>(*this));
    parts_.push_back(std::make_unique<trouble>(*this));
}

world::~world() {
    time_.clear();
    for (auto& n : nodes_) {
        if (n) {
            end_run(*n);
            n.reset();
        }
    }
}

std::shared_ptr<node_run> world::make(const std::string& name, unsigned host, unsigned run) {
    return std::make_shared<node_run>(net_, host, run, name,
                                      node_run::options{.seed = chance_.next(),
                                                        .bounds = plan_.small_limits ? small_limits() : limits{},
                                                        .strangers = plan_.strangers,
                                                        .multicast = plan_.group,
                                                        .judge = this});
}

void world::start(unsigned host) {
    const auto run = ++runs_[host];
    nodes_[host] = make(name_of(host), host, run);
    auto& n = *nodes_[host];
    watcher_.saw(n.name(), "starts", n.node()->epoch);
    n.start();
    for (const auto& p : parts_) {
        p->on_start(n);
    }
}

std::shared_ptr<node_run> world::begin_stranger(const std::string& name, unsigned host, unsigned run) {
    auto n = make(name, host, run);
    watcher_.saw(name, "has a namesake", n->node()->epoch);
    n->start();
    return n;
}

void world::end_run(node_run& n) {
    n.crash();
    for (const auto& p : parts_) {
        p->on_crash(n);
    }
}

void world::crash(unsigned host, milliseconds down) {
    auto& leaving = departures_[host];
    if (leaving.run == runs_[host]) {
        leaving.until = std::min(leaving.until, time_.now());
    }
    end_node(host, down);
}

void world::end_node(unsigned host, milliseconds down) {
    if (node(host) == nullptr) {
        return;
    }
    const auto gone = nodes_[host];
    end_run(*gone);
    collect(*gone);
    nodes_[host].reset();
    time_.at(time_.now() + down, [this, host] {
        if (node(host) == nullptr) {
            start(host);
        }
    });
}

void world::depart(unsigned host, milliseconds down) {
    auto* n = node(host);
    if (n == nullptr || n->frozen()) {
        return;
    }
    n->stop();
    crash(host, down);
}

void world::retire(unsigned host, milliseconds limit, milliseconds down) {
    auto* n = node(host);
    if (n == nullptr || n->frozen() || n->local().closing()) {
        return;
    }
    watcher_.saw(n->name(), "leaves in order");
    departures_[host] = {runs_[host], time_.now(), time_.now() + limit};
    for (const auto& p : parts_) {
        p->on_leaving(*n);
    }
    const auto end = [this, host, down, run = runs_[host]] {
        if (runs_[host] == run) {
            end_node(host, down);
        }
    };
    n->run([&] {
        n->local().close(limit, detail::pending_ptr{new end_of_departure{[this, end] { time_.at(time_.now(), end); }}});
    });
    end_departure_by(*n, limit + n->bounds().discard + milliseconds{100}, end);
}

void world::end_departure_by(node_run& n, milliseconds span, const agenda::action& end) {
    n.later(span, [this, &n, end] {
        // A node that was frozen notices its deadlines late.
        const auto late_until = n.thawed_at() + n.bounds().discard + milliseconds{100};
        if (time_.now() < late_until) {
            end_departure_by(n, std::chrono::ceil<milliseconds>(late_until - time_.now()), end);
            return;
        }
        watcher_.broken(rule::ends_in_time, n.name() + " has not left in time");
        end();
    });
}

void world::on_group_heard(node_run& at, const core::group_source& from, std::string_view datagram) {
    for (const auto& p : parts_) {
        p->on_group_heard(at, from, datagram);
    }
}

void world::on_group_sent(node_run& by, std::string_view line) {
    for (const auto& p : parts_) {
        p->on_group_sent(by, line);
    }
}

void world::on_neighbour(node_run& at, std::string_view node, core::membership::change what) {
    for (const auto& p : parts_) {
        p->on_neighbour(at, node, what);
    }
}

void world::collect(node_run& n) {
    for (const auto count : n.node()->counts.requests) {
        report_.requests += count;
    }
    report_.updates += n.node()->counts.updates_received;
}

void world::end_trouble() {
    watcher_.saw("world", "the trouble is over");
    net_.calm();
    for (unsigned host = 0; host < hosts(); ++host) {
        if (node(host) == nullptr) {
            start(host);
        }
        node(host)->thaw();
    }
    for (const auto& p : parts_) {
        p->on_calm();
    }
}

report world::live() {
    for (unsigned host = 0; host < hosts(); ++host) {
        start(host);
    }
    time_.watch([this] {
        if (const auto& n = nodes_[time_.steps() / 64 % nodes_.size()]) {
            n->check_bounds();
        }
    });
    const auto begun = time_.now();
    auto last = begun;
    for (const auto& a : plan_.actions) {
        last = std::max(last, begun + milliseconds{a.at_ms});
        time_.at(begun + milliseconds{a.at_ms}, [this, &a] {
            for (const auto& p : parts_) {
                p->perform(a);
            }
        });
    }
    time_.run_until(last + milliseconds{1});
    report_.node_seconds = std::chrono::duration<double>(time_.now() - begun).count() * hosts();
    end_trouble();
    pass(memory_of_datagrams);
    for (const auto& p : parts_) {
        p->probe();
    }
    pass(probing);
    for (const auto& p : parts_) {
        p->judge_probe();
    }
    for (const auto& p : parts_) {
        p->wind_down();
    }
    pass(quiet);
    for (const auto& p : parts_) {
        p->judge_rest();
    }
    for (const auto& n : nodes_) {
        n->check_rest();
        collect(*n);
    }
    report_.violations = watcher_.violations();
    report_.hash = watcher_.hash();
    report_.steps = time_.steps();
    report_.datagrams = net_.datagrams();
    report_.stream_bytes = net_.stream_bytes;
    return report_;
}

} // namespace cles::simulation
