// SPDX-License-Identifier: BSL-1.0
#include "node/membership/announcement.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"
#include "simulation/world/world.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

namespace cles::simulation {
namespace {

using core::membership;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr milliseconds look_every{400};
constexpr milliseconds slack{50};
constexpr seconds until_all_know{10}; // two intervals of 3.5 s for ended incarnations, and time to be received
constexpr seconds namesake_lives{6};

constexpr milliseconds until_silent(milliseconds interval) { return interval * 7 / 2; }
constexpr milliseconds until_gone(milliseconds interval) { return interval * 15; }

std::string run_text(std::string_view node, std::uint32_t epoch) {
    return std::string{node} + " (" + protocol::epoch_text(epoch) + ")";
}

class neighbouring final : public part {
  public:
    using part::part;
    ~neighbouring() override {
        for (const auto& [host, n] : namesakes_) {
            n->crash();
        }
    }

    void perform(const action& a) override {
        if (a.what == deed::namesake && world_.has_group() && !world_.secured()) {
            begin_namesake(a["host"]);
            world_.time().later(milliseconds{a["for"]}, [this, host = a["host"], silently = a["silent"] != 0] {
                end_namesake(host, silently);
            });
        }
    }

    void on_start(node_run& n) override {
        record_begin(n);
        if (world_.has_group() && !std::exchange(looking_, true)) {
            look_at_all();
        }
    }

    void on_crash(node_run& n) override { accounts_.erase(&n); }

    void on_group_heard(node_run& at, const core::group_source& from, std::string_view datagram) override {
        protocol::request_line update;
        core::announcement said;
        std::string why;
        if (!protocol::parse_group_message(datagram, update) || !update.is_update() || update.noun.task != "cles") {
            return;
        }
        if (update.noun.path == core::load_path) {
            on_load_heard(at, from, update);
            return;
        }
        if (!read_announcement(update, said, why) || (world_.secured() && !contains(said.sources, from))) {
            return;
        }
        auto& r = accounts_[&at].runs[*update.epoch];
        if (*update.seq <= r.seq) { // reordered
            return;
        }
        if (said.leaving) {
            const auto known = at.node()->peers.find_member(said.node);
            r.left = known && known->epoch == *update.epoch;
            r.seq = r.left ? *update.seq : r.seq;
            return;
        }
        r.node = said.node;
        r.seq = *update.seq;
        r.at = at.now();
        r.interval = said.interval;
        r.sources = said.sources;
    }

    void on_neighbour(node_run& at, std::string_view node, membership::change what) override {
        auto& mine = accounts_[&at];
        const auto known = at.node()->peers.find_member(node);
        const auto owner = mine.owners.find(node);
        const auto* before = owner == mine.owners.end() ? nullptr : &mine.runs[owner->second];
        const auto audible_until = [&](milliseconds (*span)(milliseconds)) {
            return before == nullptr || before->left ? time_point::min()
                                                     : last_chance(at, *before) + span(before->interval);
        };
        const auto complain_if_heard = [&](time_point until, const char* as) {
            if (at.now() < until) {
                complain(rule::nobody_lost, at, "takes " + run_text(node, owner->second) + " for " + as);
            }
        };
        switch (what) {
        case membership::change::silent: complain_if_heard(audible_until(until_silent), "silent"); break;
        case membership::change::gone: complain_if_heard(audible_until(until_gone), "gone"); break;
        case membership::change::left:
            if (before == nullptr || !before->left) {
                complain(rule::nobody_lost, at, "says that " + std::string{node} + " has left, which it has not");
            }
            break;
        case membership::change::moved:
            if (known && owner != mine.owners.end() && known->epoch != owner->second && !mine.silent.contains(node) &&
                !has_precedence(known->epoch, owner->second) && could_answer(at, node, owner->second)) {
                complain_if_heard(audible_until(until_silent), "another");
            }
            break;
        case membership::change::clash: mine.clashes.emplace(node); break;
        default: break;
        }
        mine.silent.erase(std::string{node});
        if (known && known->suspect) {
            mine.silent.emplace(node);
        }
        if (known) {
            mine.owners.insert_or_assign(std::string{node}, known->epoch);
        } else if (what != membership::change::clash) {
            mine.owners.erase(std::string{node});
        }
    }

    void on_calm() override {
        if (!world_.has_group()) {
            return;
        }
        while (!namesakes_.empty()) {
            end_namesake(namesakes_.begin()->first, true);
        }
        // With security, all need the newest roster first.
        const auto soon = world_.secured() ? 2 * until_all_know : until_all_know;
        world_.time().later(soon, [this] { expect_all_known("soon"); });
    }

    void probe() override {
        if (!world_.has_group()) {
            return;
        }
        expect_all_known("for long");
        for (auto& [n, mine] : accounts_) {
            mine.clashes.clear();
        }
        if (world_.secured()) { // a name belongs to a key
            return;
        }
        begin_namesake(0);
        world_.time().later(namesake_lives, [this] {
            for (auto* n : world_.running()) {
                if (!accounts_[n].clashes.contains(world::name_of(0))) {
                    complain(rule::clashes_told, *n, "does not say that there is a second " + world::name_of(0));
                }
                const auto known = n->node()->peers.find_member(world::name_of(0));
                if (n->host() != 0 && (!known || protocol::epoch_text(known->epoch) != world_.node(0)->node()->epoch)) {
                    complain(rule::clashes_told, *n, "asks a namesake for " + world::name_of(0));
                }
            }
            end_namesake(0, false);
        });
    }

    void judge_probe() override {
        if (!world_.has_group()) {
            return;
        }
        expect_all_known("still");
        for (auto* n : world_.running()) {
            for (const auto& p : n->node()->peers.list(n->now())) {
                if (p.state == peer_state::clash) {
                    complain(rule::clashes_told, *n, "still lists a second " + p.node);
                }
            }
        }
    }

    void wind_down() override {
        looking_ = false;
        for (auto* n : world_.running()) {
            if (n->group() == nullptr) {
                continue;
            }
            n->run([&] {
                if (n->host() % 2 == 0) {
                    n->local().discovery().leave();
                } else {
                    n->fall_silent();
                }
            });
        }
    }

  private:
    /// What a node has received from an incarnation of another one.
    struct received_run {
        std::string node;
        std::uint64_t seq = 0;
        time_point at{};
        time_point reported{}; ///< its load, perhaps by somebody who has repeated it
        milliseconds interval{0};
        bool left = false; ///< announced that it leaves, and was listed then
        std::vector<core::group_source> sources;
    };
    /// What a node has received and reported.
    struct account {
        std::map<std::uint32_t, received_run> runs;               // by epoch
        std::map<std::string, std::uint32_t, std::less<>> owners; // of names: their epochs
        std::set<std::string, std::less<>> silent;
        std::set<std::string, std::less<>> clashes;
    };

    void record_begin(node_run& n) { began_[*protocol::parse_epoch(n.node()->epoch)] = n.now(); }
    void begin_namesake(unsigned of) {
        auto& n = namesakes_[of];
        if (!n) {
            n = world_.begin_namesake(world::name_of(of), world_.hosts() + of, ++namesake_runs_);
            record_begin(*n);
        }
    }

    void end_namesake(unsigned of, bool silently) {
        const auto found = namesakes_.extract(of);
        if (!found) {
            return;
        }
        auto& n = *found.mapped();
        if (!silently) {
            n.stop();
        }
        world_.end_run(n);
    }

    static bool contains(const std::vector<core::group_source>& sources, const core::group_source& from) {
        return std::ranges::find(sources, from) != sources.end();
    }

    // A sign of life, unless it is a copy.
    void on_load_heard(node_run& at, const core::group_source& from, const protocol::request_line& report) {
        auto& runs = accounts_[&at].runs;
        const auto found = runs.find(*report.epoch);
        if (found != runs.end() && found->second.node == report.noun.target && *report.seq >= found->second.seq &&
            !found->second.left && contains(found->second.sources, from)) {
            found->second.reported = at.now();
        }
    }

    // -- checks ----------------------------------------------------------------------------------------------------

    // Silence counts from the last announcement, or from when the receiver was back.
    [[nodiscard]] static time_point last_chance(const node_run& n, const received_run& r) {
        return std::max(r.at, n.back_since());
    }

    // Whether that incarnation has existed and been reachable for long enough to reply to a probe.
    [[nodiscard]] bool could_answer(node_run& at, std::string_view node, std::uint32_t epoch) {
        constexpr seconds enough{2};
        const auto listens = [&](node_run& n) {
            return !n.frozen() && n.thawed_at() + enough < n.now() && !n.was_frozen_until_now();
        };
        auto all = world_.running();
        for (const auto& [host, n] : namesakes_) {
            all.push_back(n.get());
        }
        const auto asked = std::ranges::find_if(
            all, [&](node_run* n) { return n->name() == node && n->node()->epoch == protocol::epoch_text(epoch); });
        return asked != all.end() && listens(at) && listens(**asked) &&
               world_.net().undisturbed_since(world_.time().now() - enough);
    }

    // Of two incarnations of one name the earlier one keeps it. A node that received the later one first learns this by
    // asking both.
    [[nodiscard]] bool has_precedence(std::uint32_t epoch, std::uint32_t over) const {
        const auto later = began_.at(epoch) - began_.at(over);
        return later <= seconds{0} || (later <= core::name_conflicts::same_start_tolerance && epoch < over);
    }

    void look_at_all() {
        if (!looking_) {
            return;
        }
        for (auto* n : world_.running()) {
            if (!n->frozen() && !n->was_frozen_until_now()) {
                n->node()->peers.for_each([&](const membership::member& other) { look_at(*n, other); });
            }
        }
        world_.time().later(look_every, [this] { look_at_all(); });
    }

    void look_at(node_run& n, const membership::member& other) {
        const auto& runs = accounts_[&n].runs;
        const auto found = runs.find(other.epoch);
        const auto complain_that = [&](const std::string& does, const char* what) {
            complain(rule::gone_in_time, n, does + " " + run_text(other.node, other.epoch) + what);
        };
        if (found == runs.end() || found->second.node != other.node) {
            complain_that("lists", ", whom it has not heard");
            return;
        }
        const auto& r = found->second;
        const auto since = std::max({r.at, r.reported, n.thawed_at()});
        if (r.left) {
            complain_that("lists", ", who has left");
        } else if (n.now() > since + until_gone(r.interval) + slack) {
            complain_that("lists", ", who is silent");
        } else if (!other.suspect && n.now() > since + until_silent(r.interval) + slack) {
            complain_that("does not suspect", ", who is silent");
        }
    }

    void expect_all_known(const char* when) {
        const auto all = world_.running();
        for (auto* n : all) {
            const auto& others = n->node()->peers;
            for (auto* other : all) {
                const auto& name = other->name();
                const auto known = others.find_member(name);
                if (other == n) {
                    continue;
                }
                if (!known || known->suspect || protocol::epoch_text(known->epoch) != other->node()->epoch) {
                    complain(rule::others_known, *n,
                             "does not " + std::string{when} + " know " + name + " as it is" +
                                 (known ? ", but as " + run_text(name, known->epoch) : std::string{}));
                } else if (known->where != world_.net().url_of(other->host(), carrier::stream) ||
                           others.address_of(name) != known->where) {
                    complain(rule::others_known, *n, "takes " + name + " to be at " + std::string{known->where});
                }
            }
            if (others.size() >= world_.hosts()) {
                complain(rule::others_known, *n, "knows " + std::to_string(others.size()) + " others");
            }
        }
    }

    std::map<const node_run*, account> accounts_;
    std::map<unsigned, std::shared_ptr<node_run>> namesakes_; // by host
    std::map<std::uint32_t, time_point> began_;               // of each run, by epoch
    unsigned namesake_runs_ = 0;
    bool looking_ = false;
};

} // namespace

std::unique_ptr<part> make_neighbouring(world& in) { return std::make_unique<neighbouring>(in); }

} // namespace cles::simulation
