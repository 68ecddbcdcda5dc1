// SPDX-License-Identifier: BSL-1.0
#include "simulation/workload/following.hpp"

#include "simulation/world/world.hpp"

#include <algorithm>
#include <utility>

namespace cles::simulation {
namespace {

using std::chrono::milliseconds;

constexpr unsigned when_there_is_room = 2; // the noun that is published so

std::string path_of(unsigned noun) {
    if (noun == 3) {
        return "notice";
    }
    return noun == 4 ? "survey" : "fix/" + std::to_string(noun);
}

/// The end of an offer to publish.
class offered_update final : public detail::pending {
  public:
    explicit offered_update(std::size_t& open) : open_(open) { ++open_; }
    verdict offer(std::string_view) override {
        delete this;
        return verdict::completed;
    }
    void fail(boost::system::error_code, std::string_view) override { delete this; }
    void discard() noexcept override { delete this; }

  private:
    ~offered_update() { --open_; }
    std::size_t& open_;
};

} // namespace

following::following(world& in) : world_(in), published_(in.hosts()) {}
following::~following() = default;

void following::on_start(node_run& n) {
    n.node()->tasks.add(verb::bind, "fix", {});
    published_[n.host()] = {};
}

void following::on_crash(node_run& n) { followers_.forget(n); }

void following::perform(const action& a) {
    switch (a.what) {
    case deed::follow: follow(a); break;
    case deed::hold: followers_.hold(a); break;
    case deed::leave: followers_.leave(a); break;
    case deed::publish: publish(a["host"], a["noun"], a["count"], a["size"]); break;
    case deed::offer: offer(a["host"], a["count"], a["size"]); break;
    default: break;
    }
}

void following::follow(const action& a) {
    auto* n = world_.node(a["from"]);
    if (n == nullptr || n->frozen() || followers_.find(a["feed"])) {
        return;
    }
    const auto target = world::name_of(a["to"]);
    const auto path = path_of(a["noun"]);
    const auto made = std::make_shared<follower>(
        *n, a["feed"], a["to"],
        core::feed_terms{.noun = target + ":" + path,
                         .at = url_of(a["to"], a["by"] == 0 ? carrier::stream : carrier::datagram),
                         .every_ms = a["every"],
                         .keep = a["keep"]},
        target, path, milliseconds{a["slow"]});
    followers_.add(made);
    n->run([&] { made->start(); });
}

// -- publishing ----------------------------------------------------------------------------------------------------

std::string following::body(unsigned host, unsigned noun, std::size_t size) {
    std::string text =
        "{\"n\":" + std::to_string(published_[host][noun] + 1) + ",\"run\":" + std::to_string(world_.runs(host));
    if (size != 0) {
        text += ",\"pad\":\"" + std::string(size, 'y') + "\"";
    }
    return text + "}";
}

void following::publish(unsigned host, unsigned noun, unsigned count, std::size_t size) {
    auto* n = world_.node(host);
    if (n == nullptr || n->frozen()) {
        return;
    }
    n->run([&] {
        for (; count != 0; --count) {
            n->local().publish(path_of(noun), [&](json_writer& w) { w.raw(body(host, noun, size)); });
            ++published_[host][noun];
        }
    });
}

void following::offer(unsigned host, unsigned count, std::size_t size) {
    auto* n = world_.node(host);
    if (n == nullptr || n->frozen()) {
        return;
    }
    n->run([&] {
        for (; count != 0; --count) {
            n->local().publish_when_room(path_of(when_there_is_room), body(host, when_there_is_room, size),
                                         detail::pending_ptr{new offered_update{offers_}});
            ++published_[host][when_there_is_room];
        }
    });
}

// -- judging -------------------------------------------------------------------------------------------------------

void following::probe() {
    for (const auto& f : followers_) {
        seen_before_probe_[f->label()] = f->seen();
    }
    for (unsigned host = 0; host < world_.hosts(); ++host) {
        publish(host, 0, 2, 10);
        publish(host, 1, 2, 10);
        offer(host, 2, 10);
        auto* n = world_.node(host);
        n->run([n] {
            for (const auto* noun : {"notice", "survey"}) {
                n->local().publish(noun, [](json_writer& w) { w.raw("{}"); });
            }
        });
    }
}

void following::judge_probe() {
    for (const auto& f : followers_) {
        if (!f->is_open()) {
            continue;
        }
        if (f->seen() == seen_before_probe_[f->label()]) {
            world_.watcher().broken(rule::feeds_receive, f->name() + " receives nothing though all is well");
            continue;
        }
        const auto to = f->to();
        for (unsigned noun = 0; noun < own_nouns; ++noun) {
            if (f->path() == path_of(noun) &&
                (f->last().run != world_.runs(to) || f->last().number != published_[to][noun])) {
                world_.watcher().broken(rule::feeds_receive, f->name() + " has got " +
                                                                 std::to_string(f->last().number) + " of " +
                                                                 std::to_string(published_[to][noun]) + " published");
            }
        }
    }
}

void following::wind_down() {
    for (const auto& f : followers_) {
        f->at().run([&] { f->close(); });
    }
    followers_.clear();
    // Whoever left without a word is noticed when something is written to him.
    for (unsigned host = 0; host < world_.hosts(); ++host) {
        world_.node(host)->later(std::chrono::seconds{1}, [this, host] {
            for (unsigned noun = 0; noun < own_nouns; ++noun) {
                publish(host, noun, 1, 0);
            }
        });
    }
}

void following::judge_rest() {
    if (offers_ != 0) {
        world_.watcher().broken(rule::at_rest, std::to_string(offers_) + " publications wait for room");
    }
}

} // namespace cles::simulation
