// SPDX-License-Identifier: BSL-1.0
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"
#include "simulation/network/group_port.hpp"
#include "simulation/workload/follower.hpp"
#include "simulation/world/world.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <utility>
#include <vector>

namespace cles::simulation {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t own_nouns = 3;         // that a node publishes by itself
constexpr unsigned waiting_noun = 2;         // the one of them that is published with publish_or_wait
constexpr const char* beacon = "beacon";     // published once by each incarnation, and bound only at the end
constexpr milliseconds repeated_within{600}; // twice the delay of a repetition, and the latency

std::string path_of(unsigned noun) {
    if (noun == own_nouns) {
        return "notice";
    }
    return noun > own_nouns ? "survey" : "fix/" + std::to_string(noun);
}

class following final : public part {
  public:
    explicit following(world& in) : part(in), published_(in.hosts()) {}

    void on_start(node_run& n) override {
        n.node()->tasks.add(verb::bind, "fix", {});
        published_[n.host()] = {};
        if (world_.has_group()) {
            n.node()->tasks.add(verb::bind, beacon, {});
            n.local().publish(beacon, [&](json_writer& w) {
                w.raw("{\"n\":1,\"run\":" + std::to_string(world_.runs(n.host())) + "}");
            });
        }
    }

    void on_crash(node_run& n) override {
        std::erase_if(followers_, [&](const auto& each) { return &each.second->at() == &n; });
        std::erase_if(nouns_, [&](const auto& each) { return each.first.first == &n; });
    }

    void perform(const action& a) override {
        switch (a.what) {
        case deed::follow: follow(a); break;
        case deed::gather: gather(a); break;
        case deed::hold:
            if (const auto f = find(a["feed"])) {
                f->hold(milliseconds{a["for"]});
            }
            break;
        case deed::leave:
            if (const auto f = find(a["feed"]); f && !f->at().frozen()) {
                f->at().run([&] { f->close(); });
                std::erase_if(followers_, [&](const auto& each) { return each.second == f; });
            }
            break;
        case deed::publish: publish(a["host"], a["noun"], a["count"], a["size"]); break;
        case deed::offer: offer(a["host"], a["count"], a["size"]); break;
        default: break;
        }
    }

    void on_group_heard(node_run& at, const core::group_source& from, std::string_view datagram) override {
        protocol::request_line bind;
        if (from == at.group()->source() || !protocol::parse_group_message(datagram, bind) || bind.verb != verb::bind ||
            bind.noun.task == "cles" || (bind.noun.target != "all" && bind.noun.target != at.name())) {
            return;
        }
        std::string scratch;
        auto& of = nouns_[{&at, std::string{protocol::canonical_path(bind.noun, scratch)}}];
        if (bind.unbinds()) {
            of.leases.erase(from);
            return;
        }
        auto& until = of.leases[from];
        of.newly_bound |= until <= at.now();
        until = at.now() + milliseconds{bind.lease_ms.value_or(protocol::default_lease_ms)};
    }

    void on_group_sent(node_run& by, std::string_view line) override {
        protocol::request_line update;
        if (!protocol::parse_group_message(line, update) || !update.is_update() || update.noun.task == "cles") {
            return;
        }
        std::string scratch;
        const std::string path{protocol::canonical_path(update.noun, scratch)};
        auto& of = nouns_[{&by, path}];
        const auto complain_that = [&](const std::string& what) {
            complain(rule::sent_once, by, "sends " + std::to_string(*update.seq) + " of " + path + " " + what);
        };
        const auto now = by.now();
        // A node that was stopped processes everything that was due meanwhile.
        if (!by.was_frozen_until_now() &&
            std::none_of(of.leases.begin(), of.leases.end(), [now](const auto& l) { return l.second >= now; })) {
            complain_that("though nobody is bound");
        }
        if (*update.seq < of.sent) {
            complain_that("after " + std::to_string(of.sent));
        } else if (*update.seq == of.sent && !std::exchange(of.newly_bound, false)) {
            complain_that("again, and nobody is newly bound");
        }
        of.sent = *update.seq;
    }

    void probe() override {
        for (const auto& [key, f] : followers_) {
            seen_before_probe_[f->how().label] = f->seen();
        }
        for (auto* n : world_.running()) {
            publish(n->host(), 0, 2, 10);
            publish(n->host(), 1, 2, 10);
            offer(n->host(), 2, 10);
            n->run([n] {
                for (const auto* noun : {"notice", "survey"}) {
                    n->local().publish(noun, [](json_writer& w) { w.raw("{}"); });
                }
            });
        }
        if (world_.has_group()) {
            probe_group();
        }
    }

    void judge_probe() override {
        for (const auto& [key, f] : followers_) {
            if (!f->is_open()) {
                continue;
            }
            const auto before = seen_before_probe_.find(f->how().label);
            if (before != seen_before_probe_.end() && f->seen() == before->second) {
                complain(rule::feeds_receive, f->name() + " receives nothing though all is well");
                continue;
            }
            for (unsigned host = 0; host < world_.hosts(); ++host) {
                if (f->wants(world::name_of(host))) {
                    judge_last(*f, host);
                }
            }
        }
    }

    void wind_down() override {
        for (const auto& [key, f] : followers_) {
            f->at().run([closed = f] { closed->close(); });
        }
        followers_.clear();
        // The failure of a peer without notice is detected when something is written to it.
        for (auto* n : world_.running()) {
            n->later(std::chrono::seconds{1}, [this, n] {
                for (unsigned noun = 0; noun < own_nouns; ++noun) {
                    publish(n->host(), noun, 1, 0);
                }
            });
        }
    }

    void judge_rest() override {
        if (const auto open = offers_.use_count() - 1; open != 0) {
            complain(rule::at_rest, std::to_string(open) + " publications wait for room");
        }
    }

  private:
    /// The state of a publisher's noun in the group.
    struct group_noun {
        std::map<core::group_source, time_point> leases; // the expiry of each
        std::uint64_t sent = 0;                          // the number of the last update
        bool newly_bound = false;                        // since the last update was repeated
    };
    using follower_ptr = std::shared_ptr<follower>;

    [[nodiscard]] follower_ptr find(std::uint32_t label) const {
        const auto found = std::find_if(followers_.begin(), followers_.end(),
                                        [&](const auto& each) { return each.second->how().label == label; });
        return found == followers_.end() ? nullptr : found->second;
    }
    follower_ptr add(node_run& n, const follower_ptr& made) {
        followers_[{made->how().by_group, made->how().label}] = made;
        n.run([&] { made->start(); });
        return made;
    }

    void follow(const action& a) {
        auto* n = world_.active(a["from"]);
        if (n == nullptr || find(a["feed"])) {
            return;
        }
        const auto target = world::name_of(a["to"]);
        const auto path = path_of(a["noun"]);
        add(*n,
            follow_by_link(*n, {.label = a["feed"], .target = target, .path = path, .slow = milliseconds{a["slow"]}},
                           {.noun = target + ":" + path,
                            .at = n->address_for(a["to"], a["by"] == 0 ? carrier::stream : carrier::datagram),
                            .every_ms = a["every"],
                            .keep = a["keep"]}));
    }

    void gather(const action& a) {
        auto* n = world_.active(a["from"]);
        if (world_.has_group() && n != nullptr && !find(a["feed"])) {
            add(*n, follow_by_group(*n, {.label = a["feed"],
                                         .target = a["all"] != 0 ? "all" : world::name_of(a["to"]),
                                         .path = path_of(a["noun"]),
                                         .slow = milliseconds{a["slow"]}}));
        }
    }

    // -- publishing ------------------------------------------------------------------------------------------------

    [[nodiscard]] std::string next_body(unsigned host, unsigned noun, std::size_t size) {
        std::string text =
            "{\"n\":" + std::to_string(published_[host][noun] + 1) + ",\"run\":" + std::to_string(world_.runs(host));
        if (size != 0) {
            text += ",\"pad\":\"" + std::string(size, 'y') + "\"";
        }
        return text + "}";
    }

    void publish(unsigned host, unsigned noun, unsigned count, std::size_t size) {
        auto* n = world_.active(host);
        if (n == nullptr) {
            return;
        }
        n->run([&] {
            for (; count != 0; --count) {
                n->local().publish(path_of(noun), [&](json_writer& w) { w.raw(next_body(host, noun, size)); });
                ++published_[host][noun];
            }
        });
    }

    void offer(unsigned host, unsigned count, std::size_t size) {
        auto* n = world_.active(host);
        if (n == nullptr) {
            return;
        }
        n->run([&] {
            for (; count != 0; --count) {
                n->local().publish_or_wait(path_of(waiting_noun), next_body(host, waiting_noun, size),
                                           when_ended([open = offers_](std::string_view) {}));
                ++published_[host][waiting_noun];
            }
        });
    }

    // -- checks ----------------------------------------------------------------------------------------------------

    void probe_group() {
        std::vector<follower_ptr> newcomers;
        for (auto* n : world_.running()) {
            const auto target = n->host() % 2 == 0 ? world::name_of((n->host() + 1) % world_.hosts()) : "all";
            newcomers.push_back(
                add(*n, follow_by_group(*n, {.label = ++next_probe_, .target = target, .path = beacon})));
        }
        world_.time().later(repeated_within, [this, newcomers] {
            for (const auto& f : newcomers) {
                for (unsigned host = 0; host < world_.hosts(); ++host) {
                    const auto name = world::name_of(host);
                    if (f->wants(name) && f->last_of(name).run != world_.runs(host)) {
                        complain(rule::first_soon, f->name() + " has not got the last update of " + name);
                    }
                }
            }
        });
    }

    void judge_last(follower& f, unsigned host) {
        const auto last = f.last_of(world::name_of(host));
        for (unsigned noun = 0; noun < own_nouns; ++noun) {
            const auto published = published_[host][noun];
            if (f.how().path == path_of(noun) && (last.run != world_.runs(host) || last.number != published)) {
                complain(rule::feeds_receive, f.name() + " has got " + std::to_string(last.number) + " of " +
                                                  std::to_string(published) + " that " + world::name_of(host) +
                                                  " has published");
            }
        }
    }

    std::map<std::pair<bool, std::uint32_t>, follower_ptr> followers_; // by whether it is by the group, and label
    std::map<std::uint32_t, std::uint64_t> seen_before_probe_;
    std::vector<std::array<std::uint64_t, own_nouns>> published_; // by the present run of each host
    std::map<std::pair<const node_run*, std::string>, group_noun> nouns_;
    std::shared_ptr<void> offers_ = std::make_shared<bool>(); // shared by those that have not completed
    std::uint32_t next_probe_ = 10'000'000;
};

} // namespace

std::unique_ptr<part> make_following(world& in) { return std::make_unique<following>(in); }

} // namespace cles::simulation
