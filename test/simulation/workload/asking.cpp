// SPDX-License-Identifier: BSL-1.0
#include "simulation/workload/asking.hpp"

#include <cles/json_reader.hpp>

#include "simulation/world/world.hpp"

#include <array>
#include <charconv>
#include <utility>

namespace cles::simulation {
namespace {

using std::chrono::milliseconds;

/// What can be asked, in the order of the number in a plan.
enum task : unsigned { echo, slow, store, keep, work, notice, survey, task_count };

struct offered {
    cles::verb verb;
    std::string_view name;
    bool has_effect;
};
constexpr std::array<offered, task_count> tasks{{
    {verb::pull, "echo", false},
    {verb::pull, "slow", false},
    {verb::push, "store", true},
    {verb::push, "keep", true},
    {verb::delegate, "work", true},
    {verb::update, "notice", true},
    {verb::update, "survey", true},
}};

constexpr std::array<std::string_view, 4> by_names{" by stream ", " by datagram ", " by the urgent stream ",
                                                   " by name "};
constexpr std::uint32_t fails = 1;
constexpr std::uint32_t never = 2;

std::uint64_t effect_key(std::uint32_t op, unsigned host, unsigned run) {
    return std::uint64_t{op} << 24U | std::uint64_t{host} << 16U | run;
}

std::uint32_t number_after(std::string_view json, std::string_view name) {
    const auto at = json.find(name);
    std::uint32_t value = 0;
    if (at != std::string_view::npos) {
        std::from_chars(json.data() + at + name.size(), json.data() + json.size(), value);
    }
    return value;
}

std::uint32_t parameter(const request& r, std::size_t index) {
    return index < r.parameters().size() ? r.parameter<std::uint32_t>(index) : 0;
}

void write_op(json_writer& w, std::uint32_t op, std::size_t size) {
    w.begin_object();
    w.key("op");
    w.value(std::uint64_t{op});
    if (size != 0) {
        w.key("pad");
        w.value(std::string(size, 'x'));
    }
    w.end_object();
}

std::string op_text(std::uint32_t op, std::size_t size = 0, std::uint32_t work_ms = 0) {
    std::string text;
    json_writer w{text};
    write_op(w, op, size);
    if (work_ms != 0) {
        text.pop_back();
        text += ",\"work\":" + std::to_string(work_ms) + "}";
    }
    return text;
}

} // namespace

bool speaks_of(std::string_view json, std::uint32_t op) {
    return json.starts_with("{\"op\":") && number_after(json, "{\"op\":") == op;
}

/// The end of a request, wherever it comes from.
class asking::answer final : public detail::pending {
  public:
    answer(asking& owner, std::uint32_t op) : owner_(owner), op_(op) {}

    verdict offer(std::string_view json) override {
        if (!detail::is_valid_answer(json)) {
            return verdict::malformed;
        }
        const std::unique_ptr<answer> self{this};
        owner_.on_success(op_, json);
        return verdict::completed;
    }
    void fail(boost::system::error_code code, std::string_view message) override {
        const std::unique_ptr<answer> self{this};
        owner_.on_failure(op_, static_cast<errc>(code.value()), message);
    }
    void discard() noexcept override { delete this; }

  private:
    asking& owner_;
    std::uint32_t op_;
};

// -- serving -------------------------------------------------------------------------------------------------------

void asking::ran(std::uint32_t op, const node_run& at) {
    const auto count = ++effects_[effect_key(op, at.host(), at.run_number())];
    if (count == 2) {
        world_.watcher().broken(rule::effects_once, "request " + std::to_string(op) + " ran twice at " + at.name());
    }
}

void asking::on_start(node_run& n) {
    offer_at_once(n);
    offer_later(n);
}

void asking::offer_at_once(node_run& n) {
    auto& registry = n.node()->tasks;
    registry.add(verb::pull, "echo",
                 {.plain = [](const request& r, json_writer& w) { write_op(w, parameter(r, 0), parameter(r, 1)); }});
    registry.add(verb::push, "store", {.plain = [this, &n](const request& r, json_writer& w) {
                     ran(parameter(r, 0), n);
                     write_op(w, parameter(r, 0), 0);
                 }});
    registry.add(verb::update, "notice", {.plain = [this, &n](const request& r, json_writer& w) {
                     const auto op = number_after(r.body(), "\"op\":");
                     ran(op, n);
                     write_op(w, op, 0);
                 }});
}

void asking::offer_later(node_run& n) {
    auto& registry = n.node()->tasks;
    const auto add = [&](task what, std::size_t first_number) {
        registry.add(tasks[what].verb, tasks[what].name,
                     {.start = [this, &n, what, first_number](const request& r, const std::shared_ptr<core::call>& c) {
                         const bool by_body = first_number == 0;
                         const auto op = by_body ? number_after(r.body(), "\"op\":") : parameter(r, 0);
                         const auto time = by_body ? number_after(r.body(), "\"work\":") : parameter(r, 1);
                         if (tasks[what].has_effect) {
                             ran(op, n);
                         }
                         begin(n, op, c, time, parameter(r, 2), parameter(r, 3));
                     }});
    };
    add(slow, 1);
    add(keep, 1);
    add(work, 1);
    add(survey, 0);
}

void asking::begin(node_run& n, std::uint32_t op, const std::shared_ptr<core::call>& call, std::uint32_t work_ms,
                   std::uint32_t steps, std::uint32_t end) {
    if (world_.fault() == planted::call_kept) {
        kept_.push_back(call);
    }
    for (std::uint32_t i = 1; i <= steps; ++i) {
        n.later(milliseconds{work_ms * i / (steps + 1)},
                [call, op, done = static_cast<double>(i) / (steps + 1)] { call->progress(done, op_text(op)); });
    }
    if (end == never) {
        held_.emplace(call.get(), call);
        call->on_stop([this, which = call.get()] { held_.erase(which); });
        return;
    }
    n.later(milliseconds{work_ms}, [call, op, end] {
        if (end == fails) {
            call->fail({.code = errc::failed, .message = "request " + std::to_string(op) + " was to fail"});
        } else {
            call->done(op_text(op));
        }
    });
}

// -- asking --------------------------------------------------------------------------------------------------------

void asking::perform(const action& a) {
    if (a.what == deed::ask) {
        ask({.op = a["op"],
             .from = a["from"],
             .to = a["to"],
             .by = static_cast<carrier>(a["by"] % 4),
             .what = a["what"] % task_count,
             .deadline = std::max(1U, a["deadline"]),
             .size = a["size"],
             .work = a["work"],
             .steps = a["steps"],
             .end = a["end"],
             .vital = false});
    } else if (a.what == deed::cancel) {
        cancel(a["op"]);
    }
}

void asking::ask(const order& o) {
    auto* n = world_.node(o.from);
    if (n == nullptr || n->frozen() || asked_.contains(o.op)) {
        return;
    }
    const auto& task = tasks[o.what];
    auto noun = world::name_of(o.to) + ":" + std::string{task.name};
    std::string body;
    if (o.what == notice || o.what == survey) {
        body = op_text(o.op, o.size, o.what == survey ? std::max(1U, o.work) : 0);
    } else {
        noun += "/" + std::to_string(o.op) + "/" + std::to_string(o.what == echo ? o.size : o.work);
        if (o.what == work) {
            noun += "/" + std::to_string(o.steps) + "/" + std::to_string(o.end);
        }
        if (task.has_effect) {
            body = op_text(o.op, o.size);
        }
    }
    auto& a = asked_[o.op];
    a = {.op = o.op,
         .from = o.from,
         .run = n->run_number(),
         .to = o.to,
         .what = o.what,
         .by = o.by,
         .deadline = world_.time().now() + milliseconds{o.deadline},
         .may_fail = o.what == work && o.end == fails,
         .vital = o.vital};
    core::outbound::progress_function progress;
    if (o.what == work && o.steps != 0) {
        progress = [this, op = o.op](double fraction, std::string_view json) { on_progress(op, fraction, json); };
    }
    n->run([&] {
        a.id = n->ask(o.to, o.by, {.verb = task.verb, .noun = noun, .body = body, .deadline = milliseconds{o.deadline}},
                      detail::pending_ptr{new answer{*this, o.op}}, std::move(progress));
    });
}

void asking::cancel(std::uint32_t op) {
    const auto found = asked_.find(op);
    if (found == asked_.end()) {
        return;
    }
    auto& a = found->second;
    auto* n = world_.node(a.from);
    if (!a.ended && n != nullptr && n->run_number() == a.run && !n->frozen()) {
        a.withdrawn = true;
        n->run([&] { n->cancel(a.id); });
        n->later(std::chrono::microseconds{1}, [this, op] { // it ends by the completion queue
            if (!asked_.at(op).ended) {
                complain(rule::ends_in_time, asked_.at(op), "was withdrawn and has not ended");
            }
        });
    }
}

// -- judging -------------------------------------------------------------------------------------------------------

void asking::complain(rule which, const asked& a, const std::string& what) {
    world_.watcher().broken(which, std::string{to_string(tasks[a.what].verb)} + " '" + std::string{tasks[a.what].name} +
                                       "' " + std::to_string(a.op) + " of " + world::name_of(a.from) + " to " +
                                       world::name_of(a.to) + std::string{by_names[static_cast<std::size_t>(a.by)]} +
                                       what);
}

bool asking::has_run(const asked& a) const {
    for (unsigned run = 1; run <= world_.runs(a.to); ++run) {
        if (effects_.contains(effect_key(a.op, a.to, run))) {
            return true;
        }
    }
    return false;
}

// It ran at a run that has begun to leave since, and cuts nothing short yet; and nothing went wrong on the way.
bool asking::is_answered_by_leaver(const asked& a) {
    const auto& left = world_.departure_of(a.to);
    if (world_.departure_of(a.from).run == world_.runs(a.from)) {
        return false; // a node that leaves gives up its own requests
    }
    const auto* n = world_.node(a.from);
    return effects_.contains(effect_key(a.op, a.to, left.run)) && world_.time().now() < left.until &&
           world_.net().undisturbed_since(left.begun) && n != nullptr && !n->was_frozen_until_now();
}

void asking::on_end(asked& a) {
    if (std::exchange(a.ended, true)) {
        complain(rule::ends_in_time, a, "ended twice");
    }
    const auto* n = world_.node(a.from);
    if (world_.time().now() > a.deadline && !(n != nullptr && n->was_frozen_until_now())) {
        complain(rule::ends_in_time, a, "ended after its deadline");
    }
}

void asking::on_progress(std::uint32_t op, double fraction, std::string_view json) {
    auto& a = asked_.at(op);
    if (a.ended || fraction < a.reported || fraction > 1 || (!speaks_of(json, op) && json != "{}")) {
        complain(rule::replies_match, a, "was told of progress " + std::to_string(fraction) + ": " + std::string{json});
    }
    a.reported = fraction;
}

void asking::on_success(std::uint32_t op, std::string_view json) {
    auto& a = asked_.at(op);
    world_.watcher().saw(world::name_of(a.from), "has an answer", json);
    on_end(a);
    a.succeeded = true;
    if (!speaks_of(json, op)) {
        complain(rule::replies_match, a, "got the answer " + std::string{json.substr(0, 80)});
    }
    if (tasks[a.what].has_effect && !has_run(a)) {
        complain(rule::replies_match, a, "is said to have run");
    }
}

void asking::on_failure(std::uint32_t op, errc code, std::string_view message) {
    auto& a = asked_.at(op);
    world_.watcher().saw(world::name_of(a.from), "has no answer", message);
    on_end(a);
    const bool may_be = code == errc::deadline || code == errc::unavailable || code == errc::busy ||
                        code == errc::too_large || (code == errc::cancelled && a.withdrawn) ||
                        (code == errc::failed && a.may_fail) ||
                        // Not known yet, or a namesake, which offers nothing.
                        (a.by == carrier::name && (code == errc::no_target || code == errc::no_task));
    if (!may_be) {
        complain(rule::replies_match, a, "failed: " + std::string{message});
    }
    if (code == errc::failed && message.find("request " + std::to_string(op) + " ") == std::string_view::npos) {
        complain(rule::replies_match, a, "failed as another: " + std::string{message});
    }
    if (code == errc::unavailable && a.by != carrier::datagram && is_answered_by_leaver(a)) {
        complain(rule::replies_match, a, "was lost though it ran at a node that left in order");
    }
    // A copy of a datagram may run once there is room again.
    if (code == errc::busy && a.by != carrier::datagram && tasks[a.what].has_effect && has_run(a)) {
        complain(rule::replies_match, a, "was refused and ran all the same");
    }
}

void asking::probe() {
    for (unsigned from = 0; from < world_.hosts(); ++from) {
        for (unsigned step = 1; step < world_.hosts(); ++step) {
            const auto to = (from + step) % world_.hosts();
            for (const auto by : {carrier::stream, carrier::datagram, carrier::urgent, carrier::name}) {
                // A name that is unknown by now breaks others_known.
                if (by == carrier::name && !world_.node(from)->node()->peers.find_member(world::name_of(to))) {
                    continue;
                }
                for (const auto what : {echo, store, work}) {
                    ask({.op = ++next_probe_,
                         .from = from,
                         .to = to,
                         .by = by,
                         .what = what,
                         .deadline = 5000,
                         .size = 20,
                         .work = 100,
                         .steps = 1,
                         .end = 0,
                         .vital = true});
                }
            }
        }
    }
}

void asking::judge_probe() {
    for (const auto& [op, a] : asked_) {
        if (a.vital && !a.succeeded) {
            complain(rule::asks_succeed, a, "did not succeed though all is well");
        }
    }
}

void asking::judge_rest() {
    for (const auto& [op, a] : asked_) {
        if (!a.ended && world_.runs(a.from) == a.run) {
            complain(rule::ends_in_time, a, "never ended");
        }
    }
    if (!held_.empty()) {
        world_.watcher().broken(rule::at_rest, std::to_string(held_.size()) + " handlers were never told to stop");
    }
}

} // namespace cles::simulation
