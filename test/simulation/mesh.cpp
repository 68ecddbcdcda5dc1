// SPDX-License-Identifier: BSL-1.0
#include "simulation/mesh.hpp"

#include <cles/gossip.hpp>
#include <cles/routing.hpp>

#include "node/membership/gossip.hpp"
#include "simulation/world/ledger.hpp"
#include "simulation/world/node_hosts.hpp"
#if CLES_SIMULATION_SECURED
#include "simulation/secured/host_security.hpp"
#include "simulation/secured/seeded_sodium.hpp"
#include "simulation/secured/virtual_fleet.hpp"
#endif

#include <algorithm>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::simulation {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr milliseconds request_limit{2000};
constexpr milliseconds until_answered{2500};

unsigned host_of(std::string_view name) { return static_cast<unsigned>(std::stoul(std::string{name.substr(1)})); }

class mesh final : public node_hosts {
  public:
    mesh(std::uint64_t seed, const mesh_setup& setup, planted fault)
        : node_hosts(seed, fault), setup_(setup),
          links_(graph::of(setup.form, setup.nodes, setup.mean_degree, chance_)), all_links_(links_) {
        if (!setup.declared) {
            net_.connect_only([this](unsigned a, unsigned b) { return all_links_.has(a, b); });
        }
        for (unsigned host = 0; host < links_.size(); ++host) {
            names_.push_back(mesh_name(host));
        }
        if (setup_.secured) {
            found_fleet(seed);
        }
        for (unsigned host = 0; host < links_.size(); ++host) {
            start(host);
        }
    }
    mesh(const mesh&) = delete;
    mesh& operator=(const mesh&) = delete;
    ~mesh() { end_all(); }

    mesh_report live() {
        report_.converged = pass_until_shortest();
        measure_traffic();
        ask_many(setup_.requests);
        for (unsigned i = 0; i < setup_.cuts; ++i) {
            lose_a_link();
        }
        for (unsigned i = 0; i < setup_.crashes; ++i) {
            crash_a_node();
        }
        judge_links();
        judge_requests();
        report_.violations = watcher_.violations();
        return report_;
    }

  private:
    void start(unsigned host) override {
        std::vector<std::string> seeds;
        std::vector<std::string> names;
        for (const auto other : all_links_.of(host)) {
            seeds.push_back(net_.url_of(other, carrier::stream));
            names.push_back(mesh_name(other));
        }
        const auto n = std::make_shared<node_run>(
            net_, host, ++runs_, mesh_name(host),
            node_run::options{.seed = chance_.next(),
                              .routing = fault() == planted::route_withheld && host == 1 ? nullptr : cles::routing(),
                              .security = security_of(host),
                              .gossip = cles::gossip(seeds, states_links() ? names : std::vector<std::string>{})});
        nodes_[host] = n;
        const auto serve = [this](const request& r, const std::shared_ptr<core::call>& c) {
            requests_.note_run(r.parameter<std::uint32_t>(0));
            c->done("{}");
        };
        n->node()->tasks.add(verb::delegate, "work", {.start = serve});
        n->start();
    }

    core::reachability& reach_of(unsigned host) { return node(host)->node()->gossip_responder->reach(); }

    [[nodiscard]] bool states_links() const noexcept { return setup_.declared && fault() != planted::links_ignored; }

#if CLES_SIMULATION_SECURED
    void found_fleet(std::uint64_t seed) {
        net_.secure();
        sodium_.emplace(seed);
        fleet_.emplace(names_);
        for (unsigned host = 0; host < links_.size(); ++host) {
            fleet_->set_rights(host, {.forwards = { "*" }});
        }
        for (unsigned host = 0; host < links_.size(); ++host) {
            fleet_->give(host);
        }
    }
    std::shared_ptr<simulated_security> security_of(unsigned host) {
        return fleet_ ? std::make_shared<host_security>(fleet_->directory_of(host), fault()) : nullptr;
    }
#else
    static void found_fleet(std::uint64_t) { throw std::runtime_error{"this simulation is built without security"}; }
    static std::shared_ptr<simulated_security> security_of(unsigned) { return nullptr; }
#endif

    // -- routes ----------------------------------------------------------------------------------------------------

    /// How many routes of that node differ from the shortest.
    std::size_t wrong_routes_of(unsigned host) {
        if (node(host) == nullptr) {
            return 0;
        }
        auto& routes = reach_of(host);
        const auto far = links_.distances(host);
        std::size_t wrong = 0;
        for (unsigned other = 0; other < links_.size(); ++other) {
            if (other != host && node(other) != nullptr) {
                wrong += routes.hops_to(names_[other]) != far[other] ? 1 : 0;
                report_.longest = std::max(report_.longest, far[other].value_or(0));
            }
        }
        return wrong;
    }

    std::size_t wrong_routes() {
        std::size_t wrong = 0;
        for (unsigned host = 0; host < links_.size(); ++host) {
            wrong += wrong_routes_of(host);
        }
        return wrong;
    }

    // Begins with the node that had a wrong route the last time, so that waiting costs little.
    bool are_all_shortest() {
        for (unsigned checked = 0; checked < links_.size(); ++checked) {
            if (wrong_routes_of(next_checked_) != 0) {
                return false;
            }
            next_checked_ = (next_checked_ + 1) % links_.size();
        }
        return true;
    }

    milliseconds pass_until_shortest() {
        const auto limit = seconds{60};
        const auto begun = time_.now();
        while (!are_all_shortest()) {
            if (time_.now() - begun > limit) {
                watcher_.broken(rule::routes_found, std::to_string(wrong_routes()) + " routes are not the shortest");
                break;
            }
            pass(milliseconds{250});
        }
        return std::chrono::duration_cast<milliseconds>(time_.now() - begun);
    }

    // Of an interval without changes.
    void measure_traffic() {
        pass(interval());
        const auto before = net_.arrived();
        pass(interval());
        report_.bytes = (net_.arrived().all - before.all) / setup_.nodes;
        report_.bytes_of_routes = (net_.arrived().routes - before.routes) / setup_.nodes;
    }

    milliseconds interval() const { return core::interval_among(links_.size() - 1); }

    // Silently: what is sent there is lost. Within one interval, requests between any two nodes have to find another
    // way, those between its ends by being sent.
    void lose_a_link() {
        const auto lost = any_link_to_spare();
        if (!lost) {
            return;
        }
        const auto [a, b] = *lost;
        const auto cut = pairs_over(a, b);
        net_.part(a, b, time_point::max());
        links_.remove(a, b);
        const auto begun = time_.now();
        const auto first = ask_until_answered(a, b, begun + interval() + seconds{1});
        report_.rerouted = std::max(report_.rerouted, first);
        if (first > interval()) {
            watcher_.broken(rule::routes_found, "requests from " + mesh_name(a) + " to " + mesh_name(b) +
                                                    " found no other way in " + std::to_string(first.count()) + " ms");
        }
        pass_until_rerouted(cut, begun);
        ask_many(setup_.requests / 4);
        pass_until_shortest();
    }

    using pair_of_hosts = std::pair<unsigned, unsigned>;

    /// The hosts on the way of a request now, as far as it gets.
    std::vector<unsigned> way(pair_of_hosts ends) {
        std::vector<unsigned> on_it{ends.first};
        for (std::string via; on_it.back() != ends.second && on_it.size() < core::route_table::max_hops;) {
            const auto at = on_it.back();
            const auto hop = reach_of(at).next_hop_to(names_[ends.second], via);
            if (hop.empty() || !links_.has(at, host_of(hop))) {
                break;
            }
            on_it.push_back(host_of(hop));
            via.append(via.empty() ? "" : ",").append(names_[at]);
        }
        return on_it;
    }

    /// The pairs whose requests are sent over that link.
    std::vector<pair_of_hosts> pairs_over(unsigned a, unsigned b) {
        std::vector<pair_of_hosts> found;
        for (unsigned to = 0; to < links_.size(); ++to) {
            if (next_hop(a, to) != b && next_hop(b, to) != a) {
                continue;
            }
            std::vector<unsigned> next;
            for (unsigned from = 0; from < links_.size(); ++from) {
                next.push_back(next_hop(from, to));
            }
            for (unsigned from = 0; from < links_.size(); ++from) {
                auto at = from;
                for (unsigned i = 0; at != to && next[at] != at && i < core::route_table::max_hops; ++i) {
                    if (std::minmax(at, next[at]) == std::minmax(a, b)) {
                        found.emplace_back(from, to);
                        break;
                    }
                    at = next[at];
                }
            }
        }
        return found;
    }

    /// The host itself if there is none.
    unsigned next_hop(unsigned host, unsigned to) {
        const auto hop = host == to ? std::string{} : reach_of(host).next_hop_to(names_[to], {});
        return hop.empty() || !links_.has(host, host_of(hop)) ? host : host_of(hop);
    }

    // Until a request between any of them would have got there for the rest of the second interval.
    void pass_until_rerouted(std::vector<pair_of_hosts> cut, time_point begun) {
        const auto step = std::max(milliseconds{20}, interval() / 100);
        auto last = milliseconds{0};
        std::size_t late = 0;
        while (time_.now() < begun + 2 * interval()) {
            pass(step);
            const auto took = std::chrono::duration_cast<milliseconds>(time_.now() - begun);
            const auto lost =
                std::ranges::count_if(cut, [this](const auto& ends) { return way(ends).back() != ends.second; });
            if (lost != 0) {
                last = took;
                late = took > interval() ? std::max(late, static_cast<std::size_t>(lost)) : late;
            }
        }
        report_.cut += cut.size();
        report_.all_rerouted = std::max(report_.all_rerouted, last);
        if (late != 0) {
            watcher_.broken(rule::routes_found, std::to_string(late) + " of " + std::to_string(cut.size()) +
                                                    " pairs without their link found no other way in " +
                                                    std::to_string(last.count()) + " ms");
        }
    }

    // The ends of a link that is lost send each other requests until one is answered.
    milliseconds ask_until_answered(unsigned a, unsigned b, time_point until) {
        const auto begun = time_.now();
        std::vector<std::uint32_t> sent;
        while (time_.now() < until) {
            sent.push_back(ask(a, b, false));
            pass(milliseconds{20});
            if (std::ranges::any_of(sent, [&](auto op) { return requests_.of(op).succeeded; })) {
                break;
            }
        }
        return std::chrono::duration_cast<milliseconds>(time_.now() - begun);
    }

    std::optional<std::pair<unsigned, unsigned>> any_link_to_spare() {
        for (int tries = 0; tries < 100; ++tries) {
            const auto a = any_host();
            const auto& others = links_.of(a);
            if (others.empty()) {
                continue;
            }
            const auto b = *std::next(others.begin(), chance_.below(static_cast<unsigned>(others.size())));
            auto without = links_;
            without.remove(a, b);
            if (without.is_connected()) {
                return std::pair{a, b};
            }
        }
        return {};
    }

    void crash_a_node() {
        const auto host = any_host();
        end_node(host, milliseconds{chance_.between(100, 3000)});
        for (unsigned i = 0; i < setup_.requests / 4; ++i) {
            const auto from = any_other_than(host);
            ask(from, any_other_than(from), false);
            pass(milliseconds{20});
        }
        pass(seconds{5});
        pass_until_shortest();
        ask_many(setup_.requests / 4);
    }

    // -- requests --------------------------------------------------------------------------------------------------

    unsigned any_host() { return chance_.below(links_.size()); }
    unsigned any_other_than(unsigned host) {
        for (;;) {
            if (const auto found = any_host(); found != host) {
                return found;
            }
        }
    }

    // All of which have to succeed.
    void ask_many(unsigned count) {
        for (; count != 0; --count) {
            const auto from = any_host();
            ask(from, any_other_than(from), true);
        }
        pass(until_answered);
    }

    std::uint32_t ask(unsigned from, unsigned to, bool vital) {
        const bool too_far = links_.distances(from)[to].value_or(0) > setup_.hops + 1;
        const auto op = requests_.add({.vital = vital && !too_far, .deadline = time_.now() + request_limit});
        if (vital && too_far) {
            too_far_.push_back(op);
        }
        auto& n = *node(from);
        n.run([&] {
            n.ask(to, carrier::name,
                  {.verb = verb::delegate,
                   .noun = mesh_name(to) + ":work/" + std::to_string(op),
                   .deadline = request_limit,
                   .hops = setup_.hops},
                  requests_.operation(op));
        });
        return op;
    }

    void judge_requests() {
        requests_.judge();
        for (const auto op : too_far_) {
            const auto& why = requests_.of(op).why;
            if (why.find("permits no more: state hops=") == std::string::npos) {
                requests_.complain(rule::replies_match, op, "went too far, or its failure does not say so: " + why);
            }
        }
        report_.requests = requests_.tally();
    }

    // The address of a link's other end shows its host.
    void judge_links() {
        for (const auto& [host, n] : nodes_) {
            for (const auto& c : n->local().connections().all()) {
                const auto where = c->peer().address;
                for (unsigned other = 0; other < links_.size(); ++other) {
                    if (other != host && !all_links_.has(host, other) && where == net_.url_of(other, carrier::stream)) {
                        watcher_.broken(rule::links_kept, mesh_name(host) + " has a link to " + mesh_name(other));
                    }
                }
            }
        }
    }

    const mesh_setup setup_;
    graph links_;
    const graph all_links_;
    std::vector<std::string> names_;
#if CLES_SIMULATION_SECURED
    std::optional<seeded_sodium> sodium_;
    std::optional<virtual_fleet> fleet_;
#endif
    unsigned next_checked_ = 0;
    ledger requests_{watcher_, time_};
    std::vector<std::uint32_t> too_far_; // requests over more links than they may be forwarded
    unsigned runs_ = 0;
    mesh_report report_;
};

} // namespace

std::string to_text(const mesh_report& r) {
    std::ostringstream out;
    out << "shortest routes after " << r.converged.count() << " ms, another way after " << r.rerouted.count()
        << " ms at most, for all of " << r.cut << " pairs after " << r.all_rerouted.count()
        << " ms; requests: " << to_text(r.requests) << ", over " << r.longest << " links at most; a node receives "
        << r.bytes << " bytes in an interval, " << r.bytes_of_routes << " of routes";
    return out.str();
}

mesh_report simulate_mesh(std::uint64_t seed, const mesh_setup& setup, planted fault) {
    return mesh{seed, setup, fault}.live();
}

} // namespace cles::simulation
