// SPDX-License-Identifier: BSL-1.0
#include "simulation/world/simulate.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace cles::simulation {
namespace {

/// Makes a plan smaller as long as it breaks the rule (delta debugging, Zeller and Hildebrandt 2002).
class shrinking {
  public:
    shrinking(plan what, rule broken, planted fault, std::size_t max_runs)
        : best_(std::move(what)), broken_(broken), fault_(fault), left_(max_runs) {}

    plan run() {
        for (bool smaller = true; smaller && left_ != 0;) {
            smaller = drop_actions();
            smaller = lower_numbers() || smaller;
        }
        drop_hosts();
        return best_;
    }

  private:
    bool try_it(const plan& p) {
        if (left_ == 0) {
            return false;
        }
        --left_;
        const bool still_breaks =
            broken_ == rule::same_trace ? simulate_twice(p, fault_).broke(broken_) : simulate(p, fault_).broke(broken_);
        if (still_breaks) {
            best_ = p;
        }
        return still_breaks;
    }

    bool drop_actions() {
        const auto before = best_.actions.size();
        for (auto piece = std::max<std::size_t>(1, before / 2); piece != 0; piece /= 2) {
            for (std::size_t at = 0; at < best_.actions.size() && left_ != 0;) {
                auto p = best_;
                const auto first = p.actions.begin() + static_cast<std::ptrdiff_t>(at);
                const auto size = std::min(piece, p.actions.size() - at);
                p.actions.erase(first, first + static_cast<std::ptrdiff_t>(size));
                if (!try_it(p)) {
                    at += piece;
                }
            }
        }
        return best_.actions.size() < before;
    }

    // A number that is an amount or a duration is easier to understand if it is 0 or small.
    bool lower_numbers() {
        bool lowered = false;
        for (std::size_t i = 0; i < best_.actions.size(); ++i) {
            const auto fields = fields_of(best_.actions[i].what);
            for (std::size_t f = 0; f < fields.size(); ++f) {
                const auto now = best_.actions[i].numbers[f];
                if (now == 0 || fields[f] == "op" || fields[f] == "feed") {
                    continue;
                }
                for (const auto less : {0U, 1U, now / 2}) {
                    auto p = best_;
                    p.actions[i].numbers[f] = less;
                    if (less < now && is_sound(p.actions[i]) && try_it(p)) {
                        lowered = true;
                        break;
                    }
                }
            }
        }
        return lowered;
    }
    // No node sends requests to itself or binds its own nouns.
    static bool is_sound(const action& a) {
        if (a.what == deed::roster) {
            return a["host"] != a["other"];
        }
        const bool between_two = a.what == deed::ask || a.what == deed::follow || a.what == deed::mute ||
                                 (a.what == deed::gather && a["all"] == 0);
        return !between_two || a["from"] != a["to"];
    }

    void drop_hosts() {
        while (best_.hosts > 2 && left_ != 0) {
            auto p = best_;
            --p.hosts;
            std::erase_if(p.actions, [&](const action& a) {
                const auto fields = fields_of(a.what);
                for (std::size_t f = 0; f < fields.size(); ++f) {
                    const bool is_host = fields[f] == "from" || fields[f] == "to" || fields[f] == "host" ||
                                         fields[f] == "other" || (a.what == deed::part && f < 2);
                    if (is_host && a.numbers[f] >= p.hosts) {
                        return true;
                    }
                }
                return false;
            });
            if (!try_it(p)) {
                return;
            }
        }
    }

    plan best_;
    rule broken_;
    planted fault_;
    std::size_t left_;
};

} // namespace

report simulate(const plan& what, planted fault, const witness::reader& reader) {
    return world{what, fault, reader}.live();
}

report simulate_twice(const plan& what, planted fault) {
    auto first = simulate(what, fault);
    const auto second = simulate(what, fault);
    if (first.hash != second.hash) {
        first.violations.push_back({rule::same_trace, "two runs of seed " + std::to_string(what.seed) + " differ"});
    }
    return first;
}

plan minimise(const plan& what, rule broken, planted fault, std::size_t max_runs) {
    return shrinking{what, broken, fault, max_runs}.run();
}

} // namespace cles::simulation
