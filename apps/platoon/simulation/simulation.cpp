// SPDX-License-Identifier: BSL-1.0
#include "platoon/simulation/simulation.hpp"

#include "platoon/driver/clock_difference.hpp"
#include "platoon/simulation/link_matrix.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <queue>
#include <utility>

namespace platoon {

std::string name_of(std::size_t i) { return "v" + std::to_string(i); }

gilbert_elliott losses_of(double loss, double burst) {
    return burst > 0 ? gilbert_elliott::bursts(loss, burst) : gilbert_elliott::independent(loss);
}

std::vector<vehicle_limits> limits_of(std::size_t vehicles, const spread& how, const vehicle_limits& same,
                                      std::uint64_t seed) {
    random_source random{seed};
    std::vector<vehicle_limits> all(vehicles, same);
    for (auto& each : all) {
        each.lag = how.least_lag + (how.most_lag - how.least_lag) * random.uniform();
        each.brake = how.least_brake + (how.most_brake - how.least_brake) * random.uniform();
    }
    return all;
}

std::vector<motion> start_positions(const std::vector<vehicle_limits>& vehicles, double spacing, double speed) {
    std::vector<motion> all;
    for (std::size_t i = 0; i < vehicles.size(); ++i) {
        const double distance = i == 0 ? 0 : wanted_distance(spacing, speed, vehicles[i].brake, vehicles[i - 1].brake);
        all.push_back({.x = i == 0 ? 0 : all.back().x - distance, .v = speed, .a = 0});
    }
    return all;
}

dialect dialect_of(const scenario& what, std::size_t i) {
    return i < what.dialects.size() ? what.dialects[i] : dialect::current;
}

driver_setup setup_of(const scenario& what, std::size_t i) {
    auto setup = what.setup;
    setup.ahead = i == 0 ? "" : name_of(i - 1);
    setup.leader = i == 0 || !what.leader_known ? "" : name_of(0);
    return setup;
}

namespace {

constexpr double announced_for = 1;       // s in which a vehicle announces that it leaves
constexpr double between_exchanges = 0.5; // s, between two requests for the clock of another vehicle

struct scheduled_event {
    double at = 0;
    enum { happening, delivery, exchange, decision, look } what = look; // in this order at the same time
    std::size_t vehicle = 0, from = 0;
    unsigned count = 0;
    std::shared_ptr<const state> heard{};

    bool operator>(const scheduled_event& other) const {
        return at != other.at ? at > other.at : what != other.what ? what > other.what : vehicle > other.vehicle;
    }
};

/// A vehicle with its driver and its radar.
struct simulated_vehicle {
    std::string name;
    driver who;
    radar sensor;
    double first = 0; ///< when it sends first
    double mute_until = -INFINITY;
    bool vanished = false, left = false;
    std::map<std::size_t, clock_difference> clocks{}; ///< of the others
};

class simulated_platoon {
  public:
    explicit simulated_platoon(const scenario& what)
        : what_(what), period_(1 / what.setup.hz), decisions_(decisions_per_update(what.setup.hz)),
          echoes_(decisions_per_echo(what.setup.radar, what.setup.hz)), links_(what.losses, what.delay, what.seed),
          requests_(what.losses, what.delay, what.seed + 500'000'000),
          result_(what.vehicles, what.setup.spacing, what.setup.limits.length) {
        const auto limits = limits_of(what.vehicles, what.differences, what.setup.limits, what.seed);
        const auto starts = start_positions(limits, what.setup.spacing, what.setup.plan.speed);
        for (std::size_t i = 0; i < what.vehicles; ++i) {
            auto setup = setup_of(what, i);
            setup.limits = limits[i];
            setup.start = starts[i];
            const double first = send_offset(i, what.vehicles, setup.hz);
            setup.start.x += setup.start.v * first;
            lane_.push_back(i);
            add(setup, first);
        }
        for (std::size_t i = 0; i < what.incidents.size(); ++i) {
            schedule_.push({.at = what.incidents[i].at, .what = scheduled_event::happening, .vehicle = i});
        }
        schedule_.push({.at = 0.1});
    }

    template <class Watch>
    verdict run(double end, const Watch& watch) {
        while (schedule_.top().at <= end) {
            const auto next = schedule_.top();
            schedule_.pop();
            switch (next.what) {
            case scheduled_event::happening: happen(next); break;
            case scheduled_event::delivery:
                all_[next.vehicle].who.receive(all_[next.from].name, *next.heard, next.at);
                break;
            case scheduled_event::exchange: exchange_clocks(next); break;
            case scheduled_event::decision: decide(next); break;
            case scheduled_event::look: look(next.at, watch); break;
            }
        }
        auto out = result_.result();
        out.ended = end >= what_.setup.plan.end();
        return out;
    }

  private:
    void add(driver_setup setup, double first) {
        const std::size_t i = all_.size();
        setup.name = name_of(i);
        all_.push_back({.name = setup.name,
                        .who = driver{setup, first},
                        .sensor = radar{setup.radar, what_.seed * 1'000'000 + 999'000 + i},
                        .first = first});
        if (what_.on_change) {
            all_.back().who.on_change = [this, name = setup.name](double now, role mode, const std::string& why) {
                what_.on_change(now, name, mode, why);
            };
        }
        schedule_.push({.at = first, .what = scheduled_event::decision, .vehicle = i});
        if (what_.delay > 0) {
            schedule_.push({.at = first + between_exchanges, .what = scheduled_event::exchange, .vehicle = i});
        }
    }

    void happen(const scheduled_event& turn) {
        const auto& what = what_.incidents[turn.vehicle];
        auto& vehicle = all_[what.vehicle];
        switch (what.what) {
        case incident::mute: vehicle.mute_until = turn.at + what.lasts; break;
        case incident::vanish: vehicle.vanished = true; break;
        case incident::split: vehicle.who.split(); break;
        case incident::leave:
            if (turn.count == 0) {
                vehicle.who.leave();
                schedule_.push({turn.at + announced_for, scheduled_event::happening, turn.vehicle, 0, 1, {}});
            } else {
                vehicle.left = true;
                std::erase(lane_, what.vehicle);
            }
            break;
        case incident::join:
        case incident::merge: merge(what.vehicle, turn.at); break;
        }
    }

    void merge(std::size_t ahead, double now) {
        auto setup = what_.setup;
        setup.ahead = all_[ahead].name;
        setup.merges = true;
        const auto place = std::find(lane_.begin(), lane_.end(), ahead);
        if (place != lane_.end() && place + 1 != lane_.end()) {
            setup.before = all_[*(place + 1)].name;
        }
        const auto there = truth(ahead, now);
        setup.start = {.x = there.x - setup.spacing, .v = there.v, .a = 0};
        all_[ahead].who.admit(name_of(all_.size()));
        add(setup, now);
    }

    [[nodiscard]] motion truth(std::size_t i, double now) const {
        const auto& vehicle = all_[i];
        return vehicle.vanished ? without_driver(vehicle.who.report(), now)
                                : advance(vehicle.who.position(), vehicle.who.command(), vehicle.who.limits().lag,
                                          now - vehicle.who.now());
    }

    void decide(const scheduled_event& turn) {
        auto& vehicle = all_[turn.vehicle];
        if (vehicle.vanished || vehicle.left) {
            return;
        }
        if (turn.count % echoes_ == 0) {
            measure(turn.vehicle, turn.at);
        }
        const bool merged = vehicle.who.mode() == role::merge;
        vehicle.who.step(turn.at);
        if (merged && vehicle.who.mode() != role::merge) {
            enter_lane(turn.vehicle);
        }
        if (turn.count % decisions_ == 0 && turn.at >= vehicle.mute_until) {
            send(turn.vehicle, turn.at);
        }
        auto next = turn;
        next.count += 1;
        next.at = vehicle.first + next.count * period_ / decisions_;
        schedule_.push(next);
    }

    // With those that it needs. Without delay, it would change nothing, because all clocks are right.
    void exchange_clocks(const scheduled_event& turn) {
        auto& vehicle = all_[turn.vehicle];
        for (std::size_t i = 0; i < all_.size(); ++i) {
            if (!vehicle.who.needs(all_[i].name)) {
                continue;
            }
            const auto there = requests_.next(turn.vehicle, i);
            const auto back = requests_.next(i, turn.vehicle);
            if (there && back) {
                auto& clock = vehicle.clocks[i];
                clock.add(turn.at, turn.at + *there, turn.at + *there + *back);
                vehicle.who.synchronise(all_[i].name, *clock.value());
            }
        }
        schedule_.push({.at = turn.at + between_exchanges, .what = scheduled_event::exchange, .vehicle = turn.vehicle});
    }

    void enter_lane(std::size_t i) {
        const double now = all_[i].who.now();
        const double x = all_[i].who.position().x;
        lane_.insert(std::find_if(lane_.begin(), lane_.end(), [&](std::size_t k) { return truth(k, now).x < x; }), i);
    }

    void measure(std::size_t i, double now) {
        const auto place = std::find(lane_.begin(), lane_.end(), i);
        if (!what_.setup.radar.fitted || place == lane_.end() || place == lane_.begin()) {
            return;
        }
        const auto self = truth(i, now);
        const auto ahead = truth(*(place - 1), now);
        const echo exact{.range = ahead.x - all_[*(place - 1)].who.limits().length - self.x, .rate = ahead.v - self.v};
        if (const auto seen = all_[i].sensor.measure(exact)) {
            all_[i].who.measure(*seen, now);
        }
    }

    void send(std::size_t from, double now) {
        auto told = all_[from].who.report();
        if (const auto how = dialect_of(what_, from); how != dialect::current) {
            told = to_state(reduced(to_message(told, 0), how), 0);
        }
        const auto said = std::make_shared<const state>(std::move(told));
        for (std::size_t i = 0; i < all_.size(); ++i) {
            if (!all_[i].who.needs(all_[from].name)) {
                continue;
            }
            if (const auto later = links_.next(from, i)) {
                schedule_.push({now + *later, scheduled_event::delivery, i, from, 0, said});
            }
        }
    }

    template <class Watch>
    void look(double now, const Watch& watch) {
        std::vector<motion> where;
        std::vector<double> desired;
        std::vector<double> lengths;
        for (const auto i : lane_) {
            where.push_back(truth(i, now));
            desired.push_back(all_[i].who.desired_distance());
            lengths.push_back(all_[i].who.limits().length);
        }
        const auto& plan = what_.setup.plan;
        if (now >= plan.recovery()) {
            result_.begin_recovery();
        }
        result_.sample(where, desired, lengths);
        if (plan.period > 0 && now >= plan.periodic_from() && now < plan.end()) {
            result_.correlate(plan.phase(now), where, desired);
        }
        if (watch) {
            std::vector<sighting> seen;
            for (std::size_t i = 0; i < all_.size(); ++i) {
                seen.push_back({truth(i, now), all_[i].who.desired_distance(), NAN, false, all_[i].who.mode()});
            }
            for (std::size_t k = 0; k < lane_.size(); ++k) {
                seen[lane_[k]].in_lane = true;
                seen[lane_[k]].distance = k == 0 ? NAN : where[k - 1].x - where[k].x;
            }
            watch(now, seen);
        }
        schedule_.push({.at = now + 0.01});
    }

    scenario what_;
    double period_;
    unsigned decisions_, echoes_;
    link_matrix links_, requests_; ///< what carries updates, and what carries requests for clocks
    assessment result_;
    std::vector<simulated_vehicle> all_;
    std::vector<std::size_t> lane_; ///< from the front to the rear
    std::priority_queue<scheduled_event, std::vector<scheduled_event>, std::greater<>> schedule_;
};

} // namespace

verdict simulate(const scenario& what, const std::function<void(double, const std::vector<sighting>&)>& watch) {
    return simulated_platoon{what}.run(what.seconds > 0 ? what.seconds : what.setup.plan.end() + 5, watch);
}

} // namespace platoon
