// SPDX-License-Identifier: BSL-1.0
#include "simulation/platoon.hpp"

#include <cles/convert.hpp>
#include <cles/error.hpp>
#include <cles/feed_event.hpp>
#include <cles/json_writer.hpp>

#include "node/publish/feed_mailbox.hpp"
#include "node/publish/group_feeds.hpp"
#include "platoon/driver/vehicle.hpp"
#include "platoon/simulation/link_matrix.hpp"
#include "simulation/world/node_hosts.hpp"

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

namespace cles::simulation {
namespace {

using std::chrono::microseconds;
using std::chrono::nanoseconds;

constexpr double head_start = 3;      // s, before the drive, in which nodes find each other
constexpr double time_of_look = 0.01; // s, between two looks at all positions
constexpr double start_utc = 1'700'000'000;

nanoseconds to_duration(double time) {
    return std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>{time});
}

/// A feed of a vehicle's states in the group, whose events a vehicle gets as they arrive.
class state_feed : public std::enable_shared_from_this<state_feed> {
  public:
    using reader = std::function<void(const detail::raw_event&)>;

    state_feed(node_run& at, const std::string& target, reader to)
        : at_(at), to_(std::move(to)), feed_(at.bounds(), at.node()->completions, target, "state") {}
    state_feed(const state_feed&) = delete;
    state_feed& operator=(const state_feed&) = delete;
    ~state_feed() { at_.local().group()->feeds().remove(feed_); }

    void start() {
        at_.local().group()->feeds().add(feed_, at_.local().now());
        fetch();
    }

  private:
    class next_event final : public detail::pending_event {
      public:
        explicit next_event(std::weak_ptr<state_feed> owner) : owner_(std::move(owner)) {}
        bool deliver(const detail::raw_event& event) override {
            if (!event.has_json()) {
                return false;
            }
            const std::unique_ptr<next_event> self{this};
            if (const auto owner = owner_.lock()) {
                owner->to_(event);
                owner->at_.later({}, if_alive(std::weak_ptr{owner}, [](state_feed& feed) { feed.fetch(); }));
            }
            return true;
        }
        void fail(boost::system::error_code, std::string_view) override { delete this; }
        void discard() noexcept override { delete this; }

      private:
        std::weak_ptr<state_feed> owner_;
    };

    void fetch() {
        if (feed_.mail().next(core::feed_mailbox::event_ptr{new next_event{weak_from_this()}})) {
            at_.later({}, if_alive(weak_from_this(), [](state_feed& feed) { feed.feed_.mail().pump(); }));
        }
    }

    node_run& at_;
    reader to_;
    core::group_feed feed_;
};

/// A vehicle and its node.
struct vehicle_host {
    explicit vehicle_host(platoon::vehicle_setup setup) : who(std::move(setup)) {}

    platoon::vehicle who;
    std::map<std::string, std::shared_ptr<state_feed>> feeds{}; ///< what it has bound
};

class platoon_hosts final : public node_hosts {
  public:
    explicit platoon_hosts(const platoon::scenario& what)
        : node_hosts(what.seed, planted::none), what_(what), links_(what.losses, what.delay, what.seed),
          result_(what.vehicles, what.setup.spacing, what.setup.limits.length),
          begun_(time_.now() + to_duration(head_start)) {
        net_.impair([this](unsigned from, unsigned to) { return fate(from, to); });
        const auto limits = platoon::limits_of(what.vehicles, what.differences, what.setup.limits, what.seed);
        const auto starts = platoon::start_positions(limits, what.setup.spacing, what.setup.plan.speed);
        for (unsigned host = 0; host < what.vehicles; ++host) {
            platoon::vehicle_setup setup{.driving = platoon::setup_of(what, host),
                                         .turn = host,
                                         .turns = what.vehicles,
                                         .start_utc = start_utc,
                                         .seed = what.seed * 1000 + host,
                                         .tells = platoon::dialect_of(what, host),
                                         .separate_truth = true};
            setup.driving.name = platoon::name_of(host);
            setup.driving.limits = limits[host];
            setup.driving.start = starts[host];
            setup.driving.start.x -= setup.driving.start.v * head_start;
            vehicles_.push_back(std::make_unique<vehicle_host>(std::move(setup)));
            start(host);
        }
    }
    platoon_hosts(const platoon_hosts&) = delete;
    platoon_hosts& operator=(const platoon_hosts&) = delete;
    ~platoon_hosts() {
        for (const auto& each : vehicles_) {
            each->feeds.clear();
        }
        end_all();
    }

    platoon_report drive() {
        const auto& plan = what_.setup.plan;
        const double end = what_.seconds > 0 ? what_.seconds : plan.end() + 5;
        look_at(time_of_look);
        time_.run_until(begun_ + to_duration(end));
        platoon_report out{.violations = watcher_.violations(), .drive = {.verdict = result_.result()}};
        out.drive.verdict.ended = end >= plan.end();
        for (const auto& each : vehicles_) {
            const auto& report = each->who.report();
            out.sent += report.sent;
            out.received += report.received;
            out.missed += report.missed;
            for (const auto& event : report.events) {
                out.drive.fallbacks += event.mode == "fallback" ? 1 : 0;
                out.drive.radar_spells += event.mode == "radar" ? 1 : 0;
                if (event.mode == "unheard") {
                    out.violations.push_back({rule::feeds_receive, event.vehicle + ": " + event.why});
                }
            }
        }
        out.datagrams = net_.datagrams();
        for (unsigned from = 0; from < vehicles_.size(); ++from) {
            for (unsigned to = 0; to < vehicles_.size(); ++to) {
                const auto carried = links_.counted(from, to);
                out.copies += carried.delivered + carried.lost;
                out.lost += carried.lost;
            }
        }
        return out;
    }

  private:
    [[nodiscard]] double now() const { return std::chrono::duration<double>(time_.now() - begun_).count(); }

    void start(unsigned host) override {
        const auto n = std::make_shared<node_run>(net_, host, 1, platoon::name_of(host),
                                                  node_run::options{.seed = chance_.next(), .multicast = true});
        nodes_[host] = n;
        n->node()->tasks.add(verb::bind, "state", {});
        n->node()->tasks.add(verb::bind, "localization", {});
        n->start();
        auto& who = vehicles_[host]->who;
        who.begin(who.setup().driving, now());
        decide_at(host, who.next());
    }

    /// The delay of what one sends another now; nothing: it is lost.
    std::optional<microseconds> fate(unsigned from, unsigned to) {
        if (from == to) {
            return microseconds{0};
        }
        const auto later = links_.next(from, to);
        return later ? std::optional{std::chrono::duration_cast<microseconds>(to_duration(*later))} : std::nullopt;
    }

    void decide_at(unsigned host, double when) {
        time_.at(begun_ + to_duration(when), [this, host] {
            node(host)->run([this, host] { decide(host); });
            decide_at(host, vehicles_[host]->who.next());
        });
    }

    void decide(unsigned host) {
        auto& self = *vehicles_[host];
        const auto told = self.who.decide();
        if (!told) {
            return;
        }
        auto& local = node(host)->local();
        local.publish("state", [&told](json_writer& w) { w.raw(cles::to_json(*told)); });
        local.publish("localization", [&told](json_writer& w) { w.raw(cles::to_json(localization_of(*told))); });
        for (const auto& each : vehicles_) { // by a link without faults
            if (each->who.seen() == self.who.name()) {
                each->who.see(self.who.name(), *told);
            }
        }
        bind(host, self);
    }

    void bind(unsigned host, vehicle_host& self) {
        const auto wanted = self.who.bound_to();
        std::erase_if(self.feeds, [&wanted](const auto& each) { return !wanted.contains(each.first); });
        for (const auto& name : wanted) {
            auto& feed = self.feeds[name];
            if (!feed) {
                feed = std::make_shared<state_feed>(*node(host), name,
                                                    [this, &self, name, first = true](const auto& event) mutable {
                                                        take(self.who, name, event, std::exchange(first, false));
                                                    });
                feed->start();
            }
        }
    }

    void take(platoon::vehicle& who, const std::string& from, const detail::raw_event& event, bool first) {
        if (event.kind == feed_event::gap) {
            who.note_gap(event.missed, now());
        } else if (event.kind == feed_event::update) {
            try {
                who.receive(from, cles::from_json<platoon::state_message>(event.body), now(), first);
            } catch (const error& e) {
                who.note(now(), "unheard", e.message());
            }
        }
    }

    [[nodiscard]] platoon::motion truth(std::size_t i, double at) const {
        const auto& who = *vehicles_[i]->who.who();
        return platoon::advance(who.position(), who.command(), who.limits().lag, at - who.now());
    }

    void look_at(double when) {
        time_.at(begun_ + to_duration(when), [this, when] {
            look(when);
            look_at(when + time_of_look);
        });
    }

    void look(double at) {
        std::vector<platoon::motion> where;
        std::vector<double> desired;
        std::vector<double> lengths;
        for (std::size_t i = 0; i < vehicles_.size(); ++i) {
            where.push_back(truth(i, at));
            desired.push_back(vehicles_[i]->who.who()->desired_distance());
            lengths.push_back(vehicles_[i]->who.who()->limits().length);
        }
        if (at >= what_.setup.plan.recovery()) {
            result_.begin_recovery();
        }
        result_.sample(where, desired, lengths);
    }

    const platoon::scenario& what_;
    platoon::link_matrix links_;
    platoon::assessment result_;
    time_point begun_;
    std::vector<std::unique_ptr<vehicle_host>> vehicles_;
};

} // namespace

platoon_report simulate_platoon(const platoon::scenario& what) { return platoon_hosts{what}.drive(); }

} // namespace cles::simulation
