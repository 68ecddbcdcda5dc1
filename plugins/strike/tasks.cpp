// SPDX-License-Identifier: BSL-1.0
#include "tasks.hpp"

#include <cles/setting_error.hpp>

#include "ledger.hpp"
#include "order.hpp"
#include "release_rules.hpp"

#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace strike {
namespace {

using cles::errc;
using cles::error;
using steady = std::chrono::steady_clock;
using milliseconds = std::chrono::duration<double, std::milli>;

constexpr std::size_t max_held = 64; // orders
constexpr double remembered_s = 60;  // a target that was attacked before the aircraft started is followed again

/// An order that waits for a second member, as it is shown to that one.
struct shown_order {
    std::string order{};
    std::string requester{};
    double lat = 0;
    double lon = 0;
    double utc = 0;
    double until = 0;
    std::optional<std::string> picture{};
};
BOOST_DESCRIBE_STRUCT(shown_order, (), (order, requester, lat, lon, utc, until, picture))

struct inventory {
    std::uint64_t left = 0;
    std::vector<std::string> orders{};
    std::optional<std::vector<shown_order>> held{};
};
BOOST_DESCRIBE_STRUCT(inventory, (), (left, orders, held))

// Who has asked for a release.
struct author {
    std::string node{}; ///< that was asked
    std::string requester{};
    std::string confirmed_by{};
    std::string forwarded_by{};
};

struct held_order {
    order what;
    author by;
    cles::responder answer;
};

aircraft_state state_of(const settings& wanted) {
    const auto usual = default_state();
    return {.at = {.lat = wanted.lat.value_or(usual.at.lat), .lon = wanted.lon.value_or(usual.at.lon)},
            .height = wanted.height.value_or(usual.height),
            .speed = wanted.speed.value_or(usual.speed),
            .scans = wanted.scans.value_or(usual.scans)};
}

release_limits limits_of(const settings& wanted) {
    const release_limits usual;
    return {.oldest_s = wanted.oldest_s.value_or(usual.oldest_s),
            .range_m = wanted.range_m.value_or(usual.range_m),
            .flight_s = wanted.flight_s.value_or(usual.flight_s),
            .widest_m = wanted.widest_m.value_or(usual.widest_m)};
}

double utc_now() { return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count(); }

std::unique_ptr<ledger> open_ledger(const settings& wanted) {
    try {
        return wanted.ledger ? std::make_unique<ledger>(*wanted.ledger) : nullptr;
    } catch (const std::runtime_error& e) {
        throw cles::setting_error("ledger", std::string{"ledger: "} + e.what());
    }
}

std::set<std::string> orders_in(const ledger* book) {
    std::set<std::string> out;
    if (book != nullptr) {
        for (const auto& each : book->before()) {
            if (each.event == "released") {
                out.insert(each.what.id);
            }
        }
    }
    return out;
}

struct shared_aircraft {
    explicit shared_aircraft(const settings& wanted)
        : book(open_ledger(wanted)), own{.limits = limits_of(wanted),
                                         .state = state_of(wanted),
                                         .weapons = magazine{wanted.weapons.value_or(4), orders_in(book.get())},
                                         .sensor = own_sensor{wanted.seed.value_or(1), state_of(wanted).at}} {
        must_be_confirmed = wanted.must_be_confirmed.value_or(false);
        const double now = utc_now();
        if (!book) {
            own.no_track_before = now;
            return;
        }
        for (const auto& each : book->before()) {
            if (each.event == "released" && now - each.utc < remembered_s) {
                remember(each.what, each.utc, own);
            }
        }
    }

    std::mutex lock;              // in an application, a test or a daemon: any thread calls
    std::unique_ptr<ledger> book; ///< null if there is none
    aircraft own;
    bool must_be_confirmed = false;
    std::map<std::string, held_order> held; ///< by id
};

// Replies why no weapon is released.
void refuse(const decision& decided, const cles::responder& answer) {
    switch (decided.kind) {
    case verdict::wrong: answer.fail(errc::bad_request, decided.why); break;
    case verdict::failed: answer.fail(errc::failed, decided.why); break;
    case verdict::refused: answer.refuse(decided.why, std::chrono::seconds{1}); break;
    case verdict::release: break;
    }
}

// Before the release, so that none is missing.
void record_release(const author& by, const order& what, const aim& aimed, double now, ledger& book) {
    const ledger_entry entry{.utc = now,
                             .event = "released",
                             .requester = by.requester,
                             .confirmed_by = by.confirmed_by,
                             .forwarded_by = by.forwarded_by,
                             .what = what,
                             .aim_lat = aimed.at.lat,
                             .aim_lon = aimed.at.lon,
                             .impact_utc = now + aimed.after_s};
    book.add(entry);
}

// Releases, unless it is a drill, and replies; `decide` has just said that it may. Returns whether it has.
bool carry_out(const order& what, const decision& decided, double now, steady::time_point begun, const author& by,
               const cles::responder& answer, shared_aircraft& shared) {
    auto& own = shared.own;
    if (!what.drill.value_or(false)) {
        if (shared.book) {
            try {
                record_release(by, what, decided.at, now, *shared.book);
            } catch (const std::runtime_error& e) { // another aircraft may have space on its disk
                answer.refuse(e.what(), std::chrono::seconds{1});
                return false;
            }
        }
        release(what, decided, now, own);
    }
    const auto& aimed = decided.at;
    answer.done(outcome{.node = by.node,
                        .order = what.id,
                        .aim_lat = aimed.at.lat,
                        .aim_lon = aimed.at.lon,
                        .sigma = aimed.sigma,
                        .plots = aimed.plots,
                        .impact_utc = now + aimed.after_s,
                        .flight_s = aimed.after_s,
                        .left = own.weapons.left(),
                        .run_ms = milliseconds{steady::now() - begun}.count()});
    return true;
}

// Keeps the order until a second member says what becomes of it. Returns whether it is kept.
bool hold_order(const order& what, const decision& decided, double now, const author& by, const cles::responder& answer,
                shared_aircraft& shared) {
    if (by.requester.empty()) {
        answer.fail(errc::denied, "orders must be confirmed by a second member, and this node has no security");
    } else if (shared.held.contains(what.id)) {
        answer.fail(errc::failed, "the order " + what.id + " is held already");
    } else if (shared.held.size() == max_held) {
        answer.refuse("too many orders are held", std::chrono::seconds{1});
    } else {
        hold(what, decided, now, shared.own);
        shared.held.emplace(what.id, held_order{what, by, answer});
        return true;
    }
    return false;
}

// Its requester waits for it no longer: its end has come, or it was cancelled.
void drop(const std::string& id, shared_aircraft& shared) {
    std::optional<held_order> dropped;
    {
        const std::scoped_lock guard{shared.lock};
        if (const auto at = shared.held.find(id); at != shared.held.end() && at->second.answer.stopped()) {
            dropped.emplace(std::move(at->second));
            shared.held.erase(at);
            shared.own.waiting.remove(id);
        }
    }
    if (dropped) {
        dropped->answer.fail(errc::cancelled, "nobody has confirmed the order " + id);
    }
}

void take_order(const cles::request& asked, const cles::responder& answer,
                const std::shared_ptr<shared_aircraft>& shared) {
    const auto begun = steady::now();
    const auto what = asked.as<order>();
    const author by{.node = std::string{asked.node()},
                    .requester = std::string{asked.requester()},
                    .confirmed_by = {},
                    .forwarded_by = std::string{asked.forwarded_by()}};
    {
        const std::scoped_lock guard{shared->lock};
        const double now = utc_now();
        const auto decided = decide(what, now, shared->own);
        if (decided.kind != verdict::release) {
            refuse(decided, answer);
            return;
        }
        if (!shared->must_be_confirmed || what.drill.value_or(false)) {
            carry_out(what, decided, now, begun, by, answer, *shared);
            return;
        }
        if (!hold_order(what, decided, now, by, answer, *shared)) {
            return;
        }
    }
    // Without the lock, because the callback may be called at once.
    answer.on_stop([weak = std::weak_ptr<shared_aircraft>{shared}, id = what.id] {
        if (const auto there = weak.lock()) {
            drop(id, *there);
        }
    });
}

// An order that is held, with its responder.
held_order take_held(const std::string& id, shared_aircraft& shared) {
    const auto at = shared.held.find(id);
    if (at == shared.held.end()) {
        throw error(errc::failed, "no order " + id + " is held");
    }
    held_order out = std::move(at->second);
    shared.held.erase(at);
    return out;
}

void check_second_key(const std::string& requester, const std::string& id, const shared_aircraft& shared) {
    const auto at = shared.held.find(id);
    if (at != shared.held.end() && (requester.empty() || requester == at->second.by.requester)) {
        throw error(errc::denied, "an order is confirmed by another member than the one that has given it");
    }
}

// All rules are applied again: time has passed since the order came, and others may have been carried out.
void confirm(const word_on_order& word, const std::string& requester, const cles::responder& answer,
             shared_aircraft& shared) {
    const auto begun = steady::now();
    check_second_key(requester, word.order, shared);
    auto one = take_held(word.order, shared);
    one.by.confirmed_by = requester;
    const double now = utc_now();
    const auto fresh = follow_up(one.what, now, shared.own);
    shared.own.waiting.remove(word.order);
    decision decided{
        .kind = verdict::refused, .why = "its own sensor does not see the target any more", .at = {}, .target = {}};
    if (fresh) {
        decided = decide(*fresh, now, shared.own);
    }
    if (decided.kind != verdict::release) {
        refuse(decided, one.answer);
        answer.fail(errc::failed, decided.why);
    } else if (one.answer.stopped()) {
        answer.fail(errc::failed, "its requester does not wait for the order any more");
    } else if (carry_out(*fresh, decided, now, begun, one.by, one.answer, shared)) {
        answer.done();
    } else {
        answer.fail(errc::failed, "the release cannot be recorded");
    }
}

void take_word(const cles::request& asked, const cles::responder& answer, shared_aircraft& shared) {
    const auto word = asked.as<word_on_order>();
    const std::string requester{asked.requester()};
    const std::scoped_lock guard{shared.lock};
    if (word.say == "confirm") {
        confirm(word, requester, answer, shared);
    } else if (word.say == "abort") {
        const auto one = take_held(word.order, shared);
        shared.own.waiting.remove(word.order);
        one.answer.fail(errc::failed, "aborted by " + (requester.empty() ? std::string{"its requester"} : requester));
        answer.done();
    } else {
        throw error(errc::bad_request, "say: confirm or abort");
    }
}

inventory inventory_of(const shared_aircraft& shared) {
    const auto& weapons = shared.own.weapons;
    inventory out{.left = weapons.left(), .orders = {weapons.orders().begin(), weapons.orders().end()}};
    for (const auto& [id, one] : shared.held) {
        if (!out.held) {
            out.held.emplace();
        }
        out.held->push_back({.order = id,
                             .requester = one.by.requester,
                             .lat = one.what.lat,
                             .lon = one.what.lon,
                             .utc = one.what.utc,
                             .until = one.what.until,
                             .picture = one.what.picture});
    }
    return out;
}

void require(bool fits, const char* key, const char* what) {
    if (!fits) {
        throw cles::setting_error(key, what);
    }
}

} // namespace

void settings::check() const {
    require(weapons.value_or(4) <= 1000, "weapons", "weapons: 1000 at most");
    require(std::abs(lat.value_or(0)) <= 89, "lat", "lat: -89 to 89 degrees");
    require(std::abs(lon.value_or(0)) <= 180, "lon", "lon: -180 to 180 degrees");
    require(height.value_or(0) >= 0 && height.value_or(0) <= 50'000, "height", "height: 0 to 50000 m");
    require(scans.value_or(0) <= 30, "scans", "scans: 30 at most"); // the search takes its time on the I/O thread
    const auto is_positive = [](const std::optional<double>& number) {
        return !number || (*number > 0 && std::isfinite(*number));
    };
    require(is_positive(range_m), "range_m", "range_m: more than 0");
    require(is_positive(flight_s), "flight_s", "flight_s: more than 0");
    require(is_positive(widest_m), "widest_m", "widest_m: more than 0");
    require(is_positive(speed), "speed", "speed: more than 0");
    require(is_positive(oldest_s), "oldest_s", "oldest_s: more than 0");
}

void register_tasks(cles::registrar& to, const settings& wanted) {
    wanted.check();
    const auto own = std::make_shared<shared_aircraft>(wanted);
    to.on_pull("strike",
               [own] {
                   const std::scoped_lock guard{own->lock};
                   return inventory_of(*own);
               },
               {.description = "Weapons that are left, and orders that were carried out or are held",
                .idempotent = true,
                .inline_ok = true});
    to.on_push("strike",
               [own](const cles::request& asked, const cles::responder& answer) { take_word(asked, answer, *own); },
               {.description = "Confirms or aborts an order that is held",
                .inline_ok = true,
                .local = true,
                .must_be_signed = wanted.must_be_signed.value_or(false)});
    to.on_delegate("strike",
                   [own](const cles::request& asked, const cles::responder& answer) { take_order(asked, answer, own); },
                   {.description = "Strikes a target: where it was, when, and how it moves",
                    .inline_ok = true,
                    .local = true, // the weapons are those of this node
                    .must_be_signed = wanted.must_be_signed.value_or(false)});
}

} // namespace strike
