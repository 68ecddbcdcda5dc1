// SPDX-License-Identifier: BSL-1.0
#include "simulation/world/ledger.hpp"

#include "simulation/world/node_run.hpp"

#include <iomanip>
#include <sstream>
#include <utility>

namespace cles::simulation {
namespace {

// Whether the reply says that the request has not run.
bool denies_run(errc code) {
    return code == errc::busy || code == errc::no_target || code == errc::no_task || code == errc::denied ||
           code == errc::bad_request;
}

} // namespace

std::string to_text(const request_tally& t) {
    auto text = std::to_string(t.asked) + " asked, " + std::to_string(t.succeeded) + " succeeded";
    for (const auto& [code, count] : t.failed) {
        text += ", " + std::to_string(count) + " " + code;
    }
    return text;
}

std::string to_text(const work_report& r) {
    std::ostringstream out;
    out << "jobs: " << to_text(r.jobs) << "; " << r.moved << " moved, " << r.returned << " returned, " << r.grants
        << " grants; " << r.faults << " faults in " << std::fixed << std::setprecision(1) << r.seconds << " s";
    return out.str();
}

std::uint32_t ledger::add(entry what) {
    entries_.push_back(std::move(what));
    return static_cast<std::uint32_t>(entries_.size());
}

detail::pending_ptr ledger::operation(std::uint32_t op, std::function<void()> then) {
    return when_ended(
        [this, op, then](std::string_view) { end(op, {.succeeded = true}, then); },
        [this, op, then](errc code, std::string_view why) { end(op, {.code = code, .why = std::string{why}}, then); });
}

void ledger::end(std::uint32_t op, const entry& how, const std::function<void()>& then) {
    auto& e = entries_.at(op - 1);
    if (++e.ends != 1) {
        complain(rule::ends_in_time, op, "ended again");
    }
    if (time_.now() > e.deadline) {
        complain(rule::ends_in_time, op, "ended after its deadline");
    }
    e.succeeded = how.succeeded;
    e.code = how.code;
    e.why = how.why;
    if (then) {
        then();
    }
}

void ledger::judge() const {
    for (std::uint32_t op = 1; op <= entries_.size(); ++op) {
        const auto& e = of(op);
        if (e.ends == 0) {
            complain(rule::ends_in_time, op, "has not ended");
        }
        if (e.ran > e.most_runs) {
            complain(rule::effects_once, op, "ran " + std::to_string(e.ran) + " times");
        }
        if (e.most_runs != any_number && e.succeeded && e.ran == 0) {
            complain(rule::replies_match, op, "succeeded and had not run");
        }
        if (e.most_runs != any_number && !e.succeeded && denies_run(e.code) && e.ran != 0) {
            complain(rule::replies_match, op, "ran, and was refused: " + e.why);
        }
        if (e.vital && !e.succeeded && !(e.may_be_refused && e.code == errc::busy)) {
            complain(rule::asks_succeed, op, "fails though all is well: " + e.why);
        }
    }
}

request_tally ledger::tally() const {
    request_tally t{.asked = entries_.size()};
    for (const auto& e : entries_) {
        if (e.succeeded) {
            ++t.succeeded;
        } else {
            ++t.failed[std::string{wire_name(e.code)}];
        }
    }
    return t;
}

} // namespace cles::simulation
