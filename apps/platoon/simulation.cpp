// SPDX-License-Identifier: BSL-1.0
#include "simulation.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <queue>

namespace platoon {

unsigned decisions_per_update(double hz) { return static_cast<unsigned>(std::ceil(100 / hz)); }

double send_offset(std::size_t i, std::size_t n, double hz) {
    return static_cast<double>(i) / static_cast<double>(n) / hz;
}

std::string name_of(std::size_t i) { return "v" + std::to_string(i); }

double failsafe_command(double last_command) {
    constexpr double fail_safe = -3; // m/s²
    return std::min(last_command, fail_safe);
}

motion start_position(std::size_t i, double spacing, double speed) {
    return {-spacing * static_cast<double>(i), speed, 0};
}

namespace {

struct scheduled_event {
    double at = 0;
    enum { delivery, decision, look } what = look; // in this order at the same time
    std::size_t vehicle = 0, from = 0;
    unsigned count = 0;
    std::shared_ptr<const state> heard{};

    bool operator>(const scheduled_event& other) const {
        return at != other.at ? at > other.at : what != other.what ? what > other.what : vehicle > other.vehicle;
    }
};

class simulated_platoon {
  public:
    explicit simulated_platoon(const scenario& what)
        : what_(what), period_(1 / what.setup.hz), decisions_(decisions_per_update(what.setup.hz)),
          result_(what.vehicles, what.setup.spacing, what.setup.limits.length) {
        for (std::size_t i = 0; i < what.vehicles; ++i) {
            auto setup = what.setup;
            setup.name = name_of(i);
            setup.ahead = i == 0 ? "" : name_of(i - 1);
            const double first = send_offset(i, what.vehicles, setup.hz);
            setup.start = start_position(i, setup.spacing, setup.plan.speed);
            setup.start.x += setup.start.v * first;
            drivers_.emplace_back(setup, first);
            if (what.on_change) {
                drivers_.back().on_change = [this, name = setup.name](double now, role mode, const std::string& why) {
                    what_.on_change(now, name, mode, why);
                };
            }
            radios_.emplace_back(what.loss, what.delay, what.seed * 1000 + i);
            schedule_.push({.at = first, .what = scheduled_event::decision, .vehicle = i});
        }
        schedule_.push({.at = 0.1});
    }

    template <class Watch>
    verdict run(double end, const Watch& watch) {
        while (schedule_.top().at <= end) {
            const auto next = schedule_.top();
            schedule_.pop();
            switch (next.what) {
            case scheduled_event::delivery:
                drivers_[next.vehicle].receive(name_of(next.from), *next.heard, next.at);
                break;
            case scheduled_event::decision: decide(next); break;
            case scheduled_event::look: look(next.at, watch); break;
            }
        }
        return result_.result();
    }

  private:
    [[nodiscard]] bool vanished(std::size_t i, double now) const {
        return static_cast<std::ptrdiff_t>(i) == what_.vanish && now >= what_.vanish_at;
    }

    void decide(const scheduled_event& turn) {
        if (vanished(turn.vehicle, turn.at)) {
            return;
        }
        auto& who = drivers_[turn.vehicle];
        who.step(turn.at);
        if (turn.count % decisions_ == 0) {
            send(turn.vehicle, turn.at);
        }
        auto next = turn;
        next.count += 1;
        next.at = send_offset(turn.vehicle, what_.vehicles, what_.setup.hz) + next.count * period_ / decisions_;
        schedule_.push(next);
    }

    void send(std::size_t from, double now) {
        const auto name = name_of(from);
        const auto said = std::make_shared<const state>(drivers_[from].report());
        for (std::size_t i = 0; i < drivers_.size(); ++i) {
            if (!drivers_[i].needs(name)) {
                continue;
            }
            if (const auto later = radios_[i].next()) {
                schedule_.push({now + *later, scheduled_event::delivery, i, from, 0, said});
            }
        }
    }

    template <class Watch>
    void look(double now, const Watch& watch) {
        std::vector<motion> where;
        for (std::size_t i = 0; i < drivers_.size(); ++i) {
            const auto& who = drivers_[i];
            const double command = vanished(i, now) ? failsafe_command(who.command()) : who.command();
            where.push_back(advance(who.position(), command, what_.setup.limits.lag, now - who.now()));
        }
        result_.sample(where);
        if (watch) {
            watch(now, where);
        }
        schedule_.push({.at = now + 0.01});
    }

    scenario what_;
    double period_;
    unsigned decisions_;
    assessment result_;
    std::vector<driver> drivers_;
    std::vector<impairment> radios_;
    std::priority_queue<scheduled_event, std::vector<scheduled_event>, std::greater<>> schedule_;
};

} // namespace

verdict simulate(const scenario& what, const std::function<void(double, const std::vector<motion>&)>& watch) {
    return simulated_platoon{what}.run(what.seconds > 0 ? what.seconds : what.setup.plan.end() + 5, watch);
}

} // namespace platoon
