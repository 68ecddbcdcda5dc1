// SPDX-License-Identifier: BSL-1.0
#include "simulation/network/dice.hpp"
#include "simulation/world/plan.hpp"

#include <algorithm>

namespace cles::simulation {
namespace {

/// Generates the actions.
class planner {
  public:
    planner(dice& chance, plan& out) : chance_(chance), plan_(out) {}

    /// Some feeds are bound from the start.
    void begin() {
        for (auto count = chance_.below(8); count != 0; --count) {
            follow();
        }
        for (auto count = plan_.group ? chance_.below(5) : 0; count != 0; --count) {
            gather();
        }
    }
    void add(std::uint32_t at) {
        at_ = at;
        if (plan_.group && chance_.chance(100)) {
            in_the_group();
            return;
        }
        const auto pick = chance_.below(1000);
        if (pick < 430) {
            ask();
        } else if (pick < 500) {
            put(deed::cancel, {1 + chance_.below(std::max(1U, op_))});
        } else if (pick < 560) {
            follow();
        } else if (pick < 580) {
            put(deed::hold, {1 + chance_.below(std::max(1U, feed_)), chance_.between(50, 4000)});
        } else if (pick < 600) {
            put(deed::leave, {1 + chance_.below(std::max(1U, feed_))});
        } else if (pick < 800) {
            put(deed::publish, {host(), chance_.below(2), burst(), size(1700)});
        } else if (pick < 830) {
            put(deed::offer, {host(), burst(), size(900)});
        } else if (pick < 880) {
            talk();
        } else {
            trouble();
        }
    }

    std::uint32_t next_request() noexcept { return ++op_; }
    /// The roster changes, often while hosts cannot reach each other, and somebody attacks.
    void add_security(std::uint32_t until) {
        for (auto count = chance_.between(1, 10); count != 0; --count) {
            at_ = chance_.below(until + 1);
            const auto a = host();
            const auto b = other(a);
            put(deed::roster, {chance_.below(6), a, b});
            if (chance_.chance(500)) {
                put(deed::part, {a, b, chance_.between(100, 4000)});
            }
        }
        for (auto count = chance_.between(5, 30); count != 0; --count) {
            at_ = chance_.below(until + 1);
            put(deed::attack, {chance_.below(8), host(), chance_.between(1, 40)});
        }
    }

  private:
    void put(deed what, std::initializer_list<std::uint32_t> numbers) {
        action a{.at_ms = at_, .what = what};
        std::copy(numbers.begin(), numbers.end(), a.numbers.begin());
        plan_.actions.push_back(a);
    }
    unsigned host() { return chance_.below(plan_.hosts); }
    unsigned other(unsigned than) { return (than + 1 + chance_.below(plan_.hosts - 1)) % plan_.hosts; }
    unsigned burst() { return chance_.chance(150) ? chance_.between(20, 200) : chance_.between(1, 4); }
    unsigned size(unsigned most) { return chance_.chance(200) ? chance_.below(most) : chance_.below(60); }

    void ask() {
        const auto from = host();
        const auto deadline = chance_.chance(300) ? chance_.between(1, 400) : chance_.between(400, 6000);
        const auto work = chance_.chance(100) ? chance_.between(1000, 5000) : chance_.below(300);
        // Some at the same time, so that their replies overlap.
        for (auto count = chance_.chance(200) ? chance_.between(2, 40) : 1U; count != 0; --count) {
            put(deed::ask, {++op_, from, other(from), chance_.below(2), chance_.below(7), deadline, size(2500), work,
                            chance_.chance(500) ? chance_.below(6) : 0,
                            chance_.chance(150) ? 1U : (chance_.chance(100) ? 2U : 0U)});
        }
    }
    void follow() {
        const auto from = host();
        put(deed::follow,
            {++feed_, from, other(from), chance_.below(2), chance_.below(5),
             chance_.chance(250) ? chance_.between(1, 900) : 0, chance_.chance(400) ? chance_.between(1, 40) : 0,
             chance_.chance(200) ? chance_.between(1, 120) : 0});
    }
    void talk() {
        put(deed::talk, {++talk_, host(), chance_.chance(200) ? chance_.between(30, 300) : chance_.between(1, 12),
                         chance_.chance(500) ? 0 : chance_.below(60), chance_.below(1'000'000), chance_.below(3),
                         chance_.chance(300) ? chance_.between(20, 2000) : 0});
    }
    void in_the_group() {
        const auto a = host();
        switch (chance_.below(7)) {
        case 0: put(deed::namesake, {a, chance_.between(300, 9000), chance_.below(2)}); break;
        case 1: put(deed::depart, {a, chance_.between(1, 6000)}); break;
        case 2: put(deed::freeze, {a, chance_.between(1000, 20'000)}); break;
        case 3: put(deed::mute, {a, other(a), chance_.between(100, 20'000)}); break;
        case 4: put(deed::jump, {a, chance_.between(10, 20'000)}); break;
        default: gather();
        }
    }
    void gather() {
        const auto from = host();
        put(deed::gather, {++feed_, from, other(from), chance_.below(2), chance_.below(2),
                           chance_.chance(200) ? chance_.between(1, 120) : 0});
    }
    void trouble() {
        switch (chance_.below(8)) {
        case 0: put(deed::crash, {host(), chance_.between(1, 3000)}); break;
        case 1: put(deed::freeze, {host(), chance_.between(1, 3000)}); break;
        case 2:
        case 3: {
            const auto a = host();
            put(deed::part, {a, other(a), chance_.between(10, 8000)});
            break;
        }
        case 4:
        case 5: put(deed::cut, {host(), chance_.below(100)}); break;
        default:
            put(deed::weather,
                {chance_.chance(600) ? chance_.below(400) : 0, chance_.chance(600) ? chance_.below(400) : 0,
                 chance_.chance(600) ? chance_.below(400) : 0, chance_.between(0, 40), chance_.between(0, 60)});
        }
    }

    dice& chance_;
    plan& plan_;
    std::uint32_t at_ = 0;
    std::uint32_t op_ = 0;
    std::uint32_t feed_ = 0;
    std::uint32_t talk_ = 0;
};

} // namespace

plan make_plan(std::uint64_t seed, unsigned actions, bool secured) {
    dice chance{seed * 2 + 1};
    plan p{.seed = seed,
           .hosts = chance.between(2, 4),
           .small_limits = chance.chance(700),
           .strangers = chance.chance(250)};
    auto pace = chance.chance(500) ? chance.between(2, 20) : chance.between(20, 150);
    // A separate generator, so that the other plans do not depend on it.
    dice group{~seed};
    p.group = group.chance(secured ? 500 : 250);
    p.secured = secured;
    if (p.group) { // membership changes take seconds
        pace = group.between(20, 150);
    }
    planner think{chance, p};
    think.begin();
    std::uint32_t at = 0;
    while (p.actions.size() < actions) {
        think.add(at);
        at += chance.below(2 * pace);
    }
    // Also from a separate generator.
    dice later{seed * 7 + 5};
    for (auto& a : p.actions) {
        if (a.what == deed::ask && a["by"] == 0 && later.chance(200)) {
            a.numbers[3] = later.chance(500) && p.group ? 3 : 2;
        }
    }
    dice departing{seed * 11 + 3};
    for (auto count = later.chance(300) ? later.between(1, 3) : 0; count != 0; --count) {
        p.actions.push_back({.at_ms = later.below(at + 1),
                             .what = deed::retire,
                             .numbers = {later.below(p.hosts), later.between(1, 2000), later.between(1, 1000)}});
        // Requests that run while their node leaves.
        const auto leaving = p.actions.back();
        const auto leaver = leaving.numbers[0];
        for (auto asks = departing.between(2, 8); asks != 0; --asks) {
            const auto from = (leaver + 1 + departing.below(p.hosts - 1)) % p.hosts;
            p.actions.push_back({.at_ms = leaving.at_ms - std::min(leaving.at_ms, departing.below(100)),
                                 .what = deed::ask,
                                 .numbers = {think.next_request(), from, leaver, departing.chance(250) ? 2U : 0U,
                                             departing.below(7), 6000, departing.below(200), departing.below(300)}});
        }
    }
    if (secured) {
        dice attacking{seed * 13 + 9};
        planner{attacking, p}.add_security(at);
    }
    return p;
}

} // namespace cles::simulation
