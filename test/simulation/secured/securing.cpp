// SPDX-License-Identifier: BSL-1.0
#include "simulation/secured/attacker.hpp"
#include "simulation/secured/host_security.hpp"
#include "simulation/secured/seeded_sodium.hpp"
#include "simulation/secured/virtual_fleet.hpp"
#include "simulation/workload/follower.hpp"
#include "simulation/world/world.hpp"

#include <boost/container_hash/hash.hpp>

#include <algorithm>
#include <chrono>
#include <map>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

namespace cles::simulation {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr seconds by_announcements{20};
constexpr seconds meeting{6};
constexpr seconds links_end_within{1}; // of a removed member, or one without the right
constexpr milliseconds back_within{300};
constexpr milliseconds roster_look_every{250};

/// The possible changes of the roster, in the order of their numbers in a plan.
enum change : unsigned { rotate, remove_one, add_one, fork, fewer_requests, fewer_offers, change_count };
constexpr unsigned attack_count = 8;

std::vector<std::string> names_of(unsigned hosts) {
    std::vector<std::string> all;
    for (unsigned host = 0; host < hosts; ++host) {
        all.push_back(world::name_of(host));
    }
    return all;
}

// Not by the library's own reading: only the rights that this file gives occur.
bool permits(const std::optional<std::vector<std::string>>& rights, verb how) {
    return !rights || std::ranges::any_of(*rights, [how](const std::string& right) {
        const auto verbs = "," + right.substr(0, right.find(' ')) + ",";
        auto name = std::string{to_string(how)};
        std::ranges::transform(name, name.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? c + ('a' - 'A') : c; });
        return verbs.find("," + name + ",") != std::string::npos;
    });
}

class securing_part final : public securing {
  public:
    explicit securing_part(world& in)
        : securing(in), chance_(in.seed() * 5 + 1), sodium_(in.seed()), fleet_(names_of(in.hosts())),
          attacker_(in.net(), chance_.next()) {}

    std::shared_ptr<simulated_security> equip(unsigned host) override {
        if (world_.fault() == planted::salt_repeated) {
            sodium_.reseed(world_.seed() + host);
        }
        if (world_.fault() == planted::roster_rolled_back && world_.runs(host) != 0) {
            fleet_.roll_back(host);
        }
        try {
            return std::make_shared<host_security>(fleet_.directory_of(host), world_.fault());
        } catch (const security::security_error& e) {
            world_.watcher().saw(world::name_of(host), "cannot start", e.what());
            return nullptr;
        }
    }

    void perform(const action& a) override {
        if (a.what == deed::roster) {
            change_roster(a["what"] % change_count, a["host"], a["other"]);
        } else if (a.what == deed::attack) {
            attacker_.attack(static_cast<attacker::deed>(a["what"] % attack_count), a["host"], a["count"],
                             fleet_.newest());
        }
    }

    void on_start(node_run& n) override {
        check_version(n);
        if (!std::exchange(looking_, true)) {
            look_at_all();
        }
    }

    void on_crash(node_run& n) override { views_.erase(&n); }

    void on_mending() override {
        fleet_.restore();
        world_.watcher().saw("fleet", "is restored in version", std::to_string(fleet_.newest().version()));
        given_ = chance_.below(world_.hosts());
        if (world_.fault() != planted::roster_withheld) {
            fleet_.give(given_);
        }
    }

    void on_calm() override {
        const auto now = world_.time().now();
        world_.time().at(now + seconds{5}, [this] { attacker_.repeat_all(); });
        // A node that has been added again is not known to those with older rosters, so it asks them first.
        for (const auto after : {seconds{2}, seconds{6}, seconds{10}}) {
            for (unsigned other = 0; other < world_.hosts() && removed_; ++other) {
                if (other != given_) {
                    world_.time().at(now + after, [this, other] { ask_about(given_, other, carrier::stream); });
                }
            }
        }
        for (unsigned round = 1; round < world_.hosts() && !world_.has_group(); ++round) {
            world_.time().at(now + round * meeting, [this] { meet(carrier::stream); });
        }
        const auto spread = world_.has_group() ? by_announcements : world_.hosts() * meeting;
        world_.time().at(now + spread, [this] {
            expect_newest("soon");
            meet(carrier::datagram); // so that they know each other's incarnations
        });
    }

    void judge_probe() override { expect_newest("though it was asked"); }

    void reboot() override {
        const auto host = chance_.below(world_.hosts());
        for (unsigned other = 0; world_.has_group() && other < world_.hosts(); ++other) {
            if (other != host) {
                auto& n = *world_.node(other);
                listeners_.push_back(follow_by_group(
                    n, {.label = 20'000'000 + other, .target = world::name_of(host), .path = "beacon"}));
                n.run([&] { listeners_.back()->start(); });
            }
        }
        world_.time().later(seconds{1}, [this, host] { restart(host); });
    }

    void wind_down() override {
        for (const auto& each : std::exchange(listeners_, {})) {
            each->at().run([each] { each->close(); });
        }
        attacker_.leave();
        looking_ = false;
    }

    // -- what is delivered -----------------------------------------------------------------------------------------

    void on_request(node_run& n, const access& what) override {
        if (what.peer.transport == "inproc") {
            return;
        }
        check_source(n, what.peer, what.path);
        check_rights(n, what.peer.name, what.verb, what.task == "cles", [&] {
            return "serves " + std::string{to_string(what.verb)} + " '" + std::string{what.path} + "' of ";
        });
    }

    void on_link_sends(node_run& n, const identity& to, std::string_view line) override {
        if (to.transport == "udp") {
            ++sent_[key_of(n.name(), to.name, line)];
        }
        if (line.starts_with("UPDATE " + n.name() + ":") && n.now() >= look_at(n).since + links_end_within) {
            check_rights(n, to.name, verb::bind, false, [] { return std::string{"sends updates to "}; });
        }
    }

    void on_link_receives(node_run& n, const identity& from, std::string_view line) override {
        check_source(n, from, line);
        const auto key = key_of(from.name, n.name(), line);
        if (++received_[key] > sent_[key]) {
            complain(rule::authentic, n,
                     "receives from " + from.name + " more often than it was sent: " + std::string{line.substr(0, 80)});
        }
    }

    void on_group_sent(node_run& by, std::string_view line) override {
        ++sent_[key_of(by.name(), {}, line.substr(0, line.find('\n')))];
    }

    void on_group_accepted(node_run& at, std::string_view member, std::string_view line) override {
        line = line.substr(0, line.find('\n'));
        if (line.starts_with("BIND ") && line.ends_with(":cles")) { // the sealed port itself sends such lines
            return;
        }
        if (++received_[key_of(member, at.name() + "=", line)] > sent_[key_of(member, {}, line)]) {
            complain(rule::authentic, at,
                     "accepts from " + std::string{member} +
                         " in the group more often than it was sent: " + std::string{line.substr(0, 80)});
        }
    }

  private:
    /// Since when a node has the roster in force.
    struct roster_view {
        std::uint32_t version = 0;
        time_point since{};
    };

    static const security::fleet& fleet_of(node_run& n) {
        return static_cast<const host_security*>(n.security())->fleet();
    }
    static std::size_t key_of(std::string_view from, std::string_view to, std::string_view line) {
        std::size_t key = 0;
        boost::hash_combine(key, from);
        boost::hash_combine(key, to);
        boost::hash_combine(key, line);
        return key;
    }

    void change_roster(unsigned what, unsigned host, unsigned other) {
        switch (what) {
        case rotate: fleet_.rotate(); break;
        case remove_one:
            removed_ = true;
            fleet_.remove(host);
            break;
        case add_one:
            fleet_.add(host);
            fleet_.give(host);
            break;
        case fork: fleet_.fork(host, other); return;
        case fewer_requests: fleet_.set_rights(host, {.may = {{"pull,bind *:*/**"}}}); break;
        default: fleet_.set_rights(host, {.offers = {{"pull *:*/**"}}});
        }
        world_.watcher().saw("fleet", "has version", std::to_string(fleet_.newest().version()));
        fleet_.give(other);
    }

    // Without announcements, rosters spread by links. Each node opens some to all others, whatever its roster says.
    void meet(carrier by) {
        for (unsigned from = 0; from < world_.hosts(); ++from) {
            for (unsigned to = 0; to < world_.hosts(); ++to) {
                if (from != to) {
                    ask_about(from, to, by);
                }
            }
        }
    }
    void ask_about(unsigned from, unsigned to, carrier by) {
        const auto noun = (by == carrier::stream ? "self" : world::name_of(to)) + ":cles";
        world_.node(from)->ask(to, by, {.verb = verb::pull, .noun = noun, .deadline = seconds{2}},
                               when_ended([](std::string_view) {}));
    }

    // -- checks ----------------------------------------------------------------------------------------------------

    void check_source(node_run& n, const identity& from, std::string_view what) {
        const auto host = endpoint_of(parse_url(from.address)).host;
        if (from.name != world::name_of(host)) {
            complain(rule::authentic, n,
                     "takes what " + from.address + " sends for that of '" + from.name +
                         "': " + std::string{what.substr(0, 80)});
        }
    }

    /// What the node does for somebody needs a right, or at least that this is a member.
    template <class Text>
    void check_rights(node_run& n, const std::string& other, verb how, bool is_open, const Text& what_it_does) {
        const auto& roster = fleet_of(n).in_force();
        const auto* const member = roster.find(other);
        const auto* const self = roster.find(n.name());
        if (member == nullptr) {
            complain(rule::removed_unserved, n, what_it_does() + other + ", who is no member");
        } else if (!is_open && (!permits(member->may, how) || (self != nullptr && !permits(self->offers, how)))) {
            complain(rule::rights_hold, n, what_it_does() + other + ", who may not");
        }
    }

    roster_view& look_at(node_run& n) {
        auto& v = views_[&n];
        if (const auto now = fleet_of(n).in_force().version(); v.version != now) {
            v = {.version = now, .since = n.now()};
        }
        return v;
    }

    void check_version(node_run& n) {
        const auto version = look_at(n).version;
        auto& highest = highest_[n.host()];
        if (version < highest) {
            complain(rule::rosters_advance, n,
                     "has version " + std::to_string(version) + " of the roster after " + std::to_string(highest));
        }
        highest = std::max(highest, version);
    }

    void look_at_all() {
        if (!looking_) {
            return;
        }
        for (auto* n : world_.running()) {
            check_version(*n);
        }
        world_.time().later(roster_look_every, [this] { look_at_all(); });
    }

    void expect_newest(const char* when) {
        for (auto* n : world_.running()) {
            if (fleet_of(*n).in_force().content() != fleet_.newest().content()) {
                complain(rule::rosters_spread, *n,
                         "does not have version " + std::to_string(fleet_.newest().version()) + " of the roster " +
                             when + ", but " + std::to_string(fleet_of(*n).in_force().version()));
            }
        }
    }

    // -- a restart -------------------------------------------------------------------------------------------------

    void restart(unsigned host) {
        world_.restart(host);
        const auto up = world_.time().now() + milliseconds{1};
        for (unsigned other = 0; other < world_.hosts(); ++other) {
            if (other != host) {
                world_.time().at(up, [this, other, host] {
                    expect_answer(other, host, carrier::stream);
                    expect_answer(other, host, carrier::datagram);
                    expect_answer(host, other, carrier::datagram);
                });
            }
        }
        for (std::uint64_t number = 2; world_.has_group() && number != 16; ++number) {
            world_.time().at(up + number * milliseconds{20}, [this, host, number] {
                world_.node(host)->local().publish("beacon", [&](json_writer& w) {
                    w.raw("{\"n\":" + std::to_string(number) + ",\"run\":" + std::to_string(world_.runs(host)) + "}");
                });
            });
        }
        world_.time().at(up + back_within, [this, host] {
            for (const auto& each : listeners_) {
                if (each->last_of(world::name_of(host)).run != world_.runs(host)) {
                    complain(rule::back_soon, each->name() + " does not receive again");
                }
            }
        });
    }

    void expect_answer(unsigned from, unsigned to, carrier by) {
        auto* n = world_.node(from);
        const auto answered = std::make_shared<bool>();
        n->run([&] {
            n->ask(to, by, {.verb = verb::pull, .noun = world::name_of(to) + ":echo/1/1", .deadline = seconds{2}},
                   when_ended([answered](std::string_view) { *answered = true; }));
        });
        world_.time().later(back_within, [this, answered, from, to, by] {
            if (!*answered) {
                complain(rule::back_soon, world::name_of(from) + " has no answer of " + world::name_of(to) +
                                              (by == carrier::stream ? " by stream" : " by datagram"));
            }
        });
    }

    dice chance_;
    seeded_sodium sodium_;
    virtual_fleet fleet_;
    attacker attacker_;
    std::map<const node_run*, roster_view> views_;
    std::map<unsigned, std::uint32_t> highest_; // version that a host has had
    std::unordered_map<std::size_t, std::uint64_t> sent_;
    std::unordered_map<std::size_t, std::uint64_t> received_;
    std::vector<std::shared_ptr<follower>> listeners_;
    unsigned given_ = 0;   // the host that gets the last roster
    bool removed_ = false; // some node, at some time
    bool looking_ = false;
};

} // namespace

std::unique_ptr<securing> make_securing(world& in) { return std::make_unique<securing_part>(in); }

} // namespace cles::simulation
