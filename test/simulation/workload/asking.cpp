// SPDX-License-Identifier: BSL-1.0
#include "node/session/call.hpp"
#include "simulation/workload/body.hpp"
#include "simulation/world/world.hpp"

#include <array>
#include <map>
#include <unordered_map>
#include <utility>

namespace cles::simulation {
namespace {

using std::chrono::milliseconds;

/// The possible requests, in the order of their numbers in a plan.
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

std::uint32_t parameter(const request& r, std::size_t index) {
    return index < r.parameters().size() ? r.parameter<std::uint32_t>(index) : 0;
}

std::uint32_t op_of(const request& r) { return static_cast<std::uint32_t>(number_after(r.body(), "\"op\":")); }

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

struct order {
    std::uint32_t op;
    unsigned from;
    unsigned to;
    carrier by;
    unsigned what;
    std::uint32_t deadline; ///< in milliseconds, like its work
    std::uint32_t size;
    std::uint32_t work;
    std::uint32_t steps;
    std::uint32_t end;
    bool vital = false; ///< has to succeed
};

class asking final : public part {
  public:
    using part::part;

    void on_start(node_run& n) override {
        auto& registry = n.node()->tasks;
        registry.add(verb::pull, "echo", {.plain = [](const request& r, json_writer& w) {
                         write_op(w, parameter(r, 0), parameter(r, 1));
                     }});
        registry.add(verb::push, "store", {.plain = [this, &n](const request& r, json_writer& w) {
                         ran(parameter(r, 0), n);
                         write_op(w, parameter(r, 0), 0);
                     }});
        registry.add(verb::update, "notice", {.plain = [this, &n](const request& r, json_writer& w) {
                         ran(op_of(r), n);
                         write_op(w, op_of(r), 0);
                     }});
        for (const auto what : {slow, keep, work, survey}) {
            registry.add(tasks[what].verb, tasks[what].name,
                         {.start = [this, &n, what](const request& r, const std::shared_ptr<core::call>& c) {
                             begin(n, what, r, c);
                         }});
        }
    }

    void perform(const action& a) override {
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
                 .end = a["end"]});
        } else if (a.what == deed::cancel) {
            cancel(a["op"]);
        }
    }

    void probe() override {
        for (unsigned from = 0; from < world_.hosts(); ++from) {
            for (unsigned step = 1; step < world_.hosts(); ++step) {
                const auto to = (from + step) % world_.hosts();
                for (const auto by : {carrier::stream, carrier::datagram, carrier::urgent, carrier::name}) {
                    // A name that is not known by now violates others_known.
                    if (by != carrier::name || world_.node(from)->node()->peers.find_member(world::name_of(to))) {
                        probe(from, to, by);
                    }
                }
            }
        }
    }

    void judge_probe() override {
        for (const auto& [op, a] : asked_) {
            if (a.vital && !a.succeeded) {
                complain(rule::asks_succeed, a, "did not succeed though all is well");
            }
        }
    }

    void judge_rest() override {
        for (const auto& [op, a] : asked_) {
            if (!a.ended && world_.runs(a.from) == a.run) {
                complain(rule::ends_in_time, a, "never ended");
            }
        }
        if (!held_.empty()) {
            complain(rule::at_rest, std::to_string(held_.size()) + " handlers were never told to stop");
        }
    }

  private:
    using part::complain;
    struct asked : order {
        unsigned run = 0; // of the node that asked
        std::uint64_t id = 0;
        time_point due{};       // by the network's clock
        bool withdrawn = false; // by its requester
        bool ended = false;
        bool succeeded = false;
        double reported = 0;
    };

    // -- handlers --------------------------------------------------------------------------------------------------

    void ran(std::uint32_t op, const node_run& at) {
        const auto count = ++effects_[effect_key(op, at.host(), at.run_number())];
        if (count == 2) {
            complain(rule::effects_once, "request " + std::to_string(op) + " ran twice at " + at.name());
        }
    }

    void begin(node_run& n, task what, const request& r, const std::shared_ptr<core::call>& call) {
        const bool by_body = what == survey;
        const auto op = by_body ? op_of(r) : parameter(r, 0);
        const auto work_ms = by_body ? number_after(r.body(), "\"work\":") : parameter(r, 1);
        const auto steps = parameter(r, 2);
        const auto end = parameter(r, 3);
        if (tasks[what].has_effect) {
            ran(op, n);
        }
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

    // -- requests --------------------------------------------------------------------------------------------------

    void ask(const order& o) {
        auto* n = world_.active(o.from);
        if (n == nullptr || asked_.contains(o.op)) {
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
        auto& a = asked_.emplace(o.op, asked{o}).first->second;
        a.run = n->run_number();
        a.due = world_.time().now() + milliseconds{o.deadline};
        core::outbound::progress_function progress;
        if (o.what == work && o.steps != 0) {
            progress = [this, &a](double fraction, std::string_view json) { on_progress(a, fraction, json); };
        }
        n->run([&] {
            a.id = n->ask(o.to, o.by,
                          {.verb = task.verb, .noun = noun, .body = body, .deadline = milliseconds{o.deadline}},
                          when_ended([this, &a](std::string_view json) { on_success(a, json); },
                                     [this, &a](errc code, std::string_view why) { on_failure(a, code, why); }),
                          std::move(progress));
        });
    }

    void cancel(std::uint32_t op) {
        const auto found = asked_.find(op);
        if (found == asked_.end()) {
            return;
        }
        auto& a = found->second;
        auto* n = world_.active(a.from);
        if (!a.ended && n != nullptr && n->run_number() == a.run) {
            a.withdrawn = true;
            n->run([&] { n->cancel(a.id); });
            n->later(std::chrono::microseconds{1}, [this, &a] { // its result is delivered through the completion queue
                if (!a.ended) {
                    complain(rule::ends_in_time, a, "was withdrawn and has not ended");
                }
            });
        }
    }

    void probe(unsigned from, unsigned to, carrier by) {
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

    // -- checks ----------------------------------------------------------------------------------------------------

    void complain(rule which, const asked& a, const std::string& what) {
        complain(which, std::string{to_string(tasks[a.what].verb)} + " '" + std::string{tasks[a.what].name} + "' " +
                            std::to_string(a.op) + " of " + world::name_of(a.from) + " to " + world::name_of(a.to) +
                            std::string{by_names[static_cast<std::size_t>(a.by)]} + what);
    }

    [[nodiscard]] bool has_run(const asked& a) const {
        for (unsigned run = 1; run <= world_.runs(a.to); ++run) {
            if (effects_.contains(effect_key(a.op, a.to, run))) {
                return true;
            }
        }
        return false;
    }

    // It ran on an incarnation that has since begun to leave and has not reached its limit, without any disturbance.
    [[nodiscard]] bool is_answered_by_leaver(const asked& a) {
        const auto& left = world_.departure_of(a.to);
        if (world_.departure_of(a.from).run == world_.runs(a.from)) {
            return false; // a node that leaves cancels its own requests
        }
        const auto* n = world_.node(a.from);
        return effects_.contains(effect_key(a.op, a.to, left.run)) && world_.time().now() < left.until &&
               world_.net().undisturbed_since(left.begun) && n != nullptr && !n->was_frozen_until_now();
    }

    // The node has just started, and the name may still be announced.
    [[nodiscard]] bool is_to_wait_for_name(const asked& a) const {
        auto* n = world_.node(a.from);
        return n != nullptr && n->now() < n->started_at() + core::discovery_grace::length &&
               !n->node()->peers.find_member(world::name_of(a.to));
    }

    void on_end(asked& a) {
        if (std::exchange(a.ended, true)) {
            complain(rule::ends_in_time, a, "ended twice");
        }
        const auto* n = world_.node(a.from);
        if (world_.time().now() > a.due && !(n != nullptr && n->was_frozen_until_now())) {
            complain(rule::ends_in_time, a, "ended after its deadline");
        }
    }

    void on_progress(asked& a, double fraction, std::string_view json) {
        if (a.ended || fraction < a.reported || fraction > 1 || (!speaks_of(json, a.op) && json != "{}")) {
            complain(rule::replies_match, a,
                     "was told of progress " + std::to_string(fraction) + ": " + std::string{json});
        }
        a.reported = fraction;
    }

    void on_success(asked& a, std::string_view json) {
        world_.watcher().saw(world::name_of(a.from), "has an answer", json);
        on_end(a);
        a.succeeded = true;
        world_.note_outcome(a.op, json);
        if (!speaks_of(json, a.op)) {
            complain(rule::replies_match, a, "got the answer " + std::string{json.substr(0, 80)});
        }
        if (tasks[a.what].has_effect && !has_run(a)) {
            complain(rule::replies_match, a, "is said to have run");
        }
    }

    void on_failure(asked& a, errc code, std::string_view message) {
        world_.watcher().saw(world::name_of(a.from), "has no answer", message);
        on_end(a);
        world_.note_outcome(a.op, "error " + std::to_string(static_cast<int>(code)));
        const bool may_be = code == errc::deadline || code == errc::unavailable || code == errc::busy ||
                            code == errc::too_large || (code == errc::cancelled && a.withdrawn) ||
                            (code == errc::failed && a.what == work && a.end == fails) ||
                            (code == errc::denied && world_.secured() && !a.vital) ||
                            // Not known yet, or another node of that name, which offers nothing.
                            (a.by == carrier::name && (code == errc::no_target || code == errc::no_task));
        if (!may_be) {
            complain(rule::replies_match, a, "failed: " + std::string{message});
        }
        if (code == errc::no_target && is_to_wait_for_name(a)) {
            complain(rule::names_awaited, a, "failed before the name could be known: " + std::string{message});
        }
        if (code == errc::failed && message.find("request " + std::to_string(a.op) + " ") == std::string_view::npos) {
            complain(rule::replies_match, a, "failed as another: " + std::string{message});
        }
        if (code == errc::unavailable && a.by != carrier::datagram && is_answered_by_leaver(a)) {
            complain(rule::replies_match, a, "was lost though it ran at a node that left in order");
        }
        if (code == errc::denied && a.by != carrier::datagram && has_run(a)) {
            complain(rule::replies_match, a, "was denied and ran all the same");
        }
        // A copy of a datagram may run once there is capacity again.
        if (code == errc::busy && a.by != carrier::datagram && tasks[a.what].has_effect && has_run(a)) {
            complain(rule::replies_match, a, "was refused and ran all the same");
        }
    }

    std::map<std::uint32_t, asked> asked_;
    std::unordered_map<std::uint64_t, unsigned> effects_;     // by request, host and run
    std::map<core::call*, std::shared_ptr<core::call>> held_; // never replied to
    std::vector<std::shared_ptr<core::call>> kept_;           // by a planted fault
    std::uint32_t next_probe_ = 10'000'000;
};

} // namespace

std::unique_ptr<part> make_asking(world& in) { return std::make_unique<asking>(in); }

} // namespace cles::simulation
