// SPDX-License-Identifier: BSL-1.0
#include "simulation/gossip_network.hpp"

#include "node/base/deadlines.hpp"
#include "node/base/metrics.hpp"
#include "node/membership/discovery.hpp"
#include "node/membership/gossip.hpp"
#include "node/membership/membership.hpp"
#include "node/membership/peer_table.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"
#include "simulation/network/place.hpp"

#include <algorithm>
#include <utility>

namespace cles::simulation {
namespace {

constexpr std::size_t headers = 52;      // of IP and TCP, with time stamps
constexpr std::size_t segment = 1448;    // the payload of a packet
constexpr std::size_t request_head = 64; // "PULL self:cles/peers id=... deadline=2000 since=", and similar
constexpr std::size_t reply_head = 12;   // "id=... "
constexpr std::size_t most_known = 2'000;
constexpr std::chrono::seconds settles{20}; // after a pause, until it is checked again

std::size_t on_the_wire(std::size_t bytes) { return bytes + headers * (1 + bytes / segment); }

// Epochs are random: consecutive numbers would be ordered.
std::uint32_t scattered(std::uint32_t n) { return n * 2654435761U; }

} // namespace

/// One incarnation of a node.
class gossip_network::member final : public place,
                                     public core::announcer::sender,
                                     public core::gossip::client,
                                     public core::membership::watcher {
  public:
    member(gossip_network& owner, std::size_t number, std::string name, std::uint32_t epoch)
        : place(owner.time_, static_cast<unsigned>(number), name), net(owner), run_number(epoch),
          url("tcp://10." + std::to_string(number / 62500) + "." + std::to_string(number / 250 % 250) + "." +
              std::to_string(number % 250 + 1) + ":25370"),
          said{.node = std::move(name), .endpoints = {"tcp://0.0.0.0:25370"}, .tasks = "85944171f73967e8"},
          others_known(said.node, epoch, deadlines, most_known),
          gossip({said.node, protocol::epoch_text(epoch)}, *this, others_known, counts, deadlines, most_known,
                 static_cast<std::uint32_t>(owner.dice_.next())),
          announcer(*this, deadlines, static_cast<std::uint32_t>(owner.dice_.next())) {
        said.load.workers = 4;
        others_known.watch(this);
    }

    void begin() {
        announcer.start(now());
        deadlines.expire(now()); // it announces itself before it sends requests
        gossip.set_seeds(net.seeds_, now());
        gossip.start(now());
    }

    void announce(milliseconds interval) override {
        said.interval = interval;
        said.load.running = static_cast<std::uint32_t>(net.dice_.below(4));
        others_known.announce_self(said, ++seq, now());
    }
    [[nodiscard]] std::size_t others() const override { return others_known.size(); }

    void ask(std::uint64_t ticket, const destination& at, const core::table_question& what) override {
        const auto fail = for_run(run_number, [ticket](member& m) { m.gossip.on_failure(ticket, m.now()); });
        const auto answer = [ticket, from = host(), run = run_number, since = std::string{what.since},
                             describe = std::string{what.describe}](member& m) {
            m.bytes += on_the_wire(request_head + since.size() + describe.size());
            std::string table;
            json_writer w{table};
            m.gossip.write_delta(w, {since, describe}, 1U << 20U, m.now());
            m.net.send(m.host(), from, table.size(), for_run(run, [ticket, table](member& asker) {
                           asker.bytes += on_the_wire(reply_head + table.size());
                           asker.gossip.on_answer(ticket, table, asker.now());
                       }));
        };
        post(at, what.since.size(), answer, fail);
        // If no reply arrives, the link's own code reports that at the deadline.
        net.deliver(net.time_.now() + core::gossip::limit, host(), fail);
    }
    void ask_description(std::uint64_t, const destination&) override {} // all nodes here know `since`
    void push(const destination& at, std::string_view pushed) override {
        post(at, pushed.size(), [table = std::string{pushed}, source = url](member& m) {
            m.bytes += on_the_wire(request_head + table.size());
            m.gossip.on_pushed_table(table, core::observed_source::at(source), m.now());
        });
    }
    void release(const destination&) override {}

    void on_peer(std::string_view node, core::membership::change what, std::string_view where) override {
        const auto about = net.by_url_.find(where);
        const bool lives = about != net.by_url_.end() && net.members_[about->second]->alive;
        if (what == core::membership::change::gone) {
            gossip.on_gone(node, where, now());
            net.false_deaths_ += lives ? 1 : 0;
        } else if (what == core::membership::change::silent) {
            net.false_suspicions_ += lives && net.members_[about->second]->stopped_until <= net.time_.now() ? 1 : 0;
        } else if (what == core::membership::change::clash) {
            ++net.clashes_;
        }
    }

    void post(const destination& at, std::size_t size, handler arrives, handler refused = {}) {
        if (const auto to = net.by_url_.find(at.url); to != net.by_url_.end()) {
            net.send(host(), to->second, size, std::move(arrives), std::move(refused));
        }
    }
    /// Another incarnation does not get what is for this one.
    static handler for_run(std::uint32_t run, handler what) {
        return [run, what = std::move(what)](member& m) {
            if (m.run_number == run) {
                what(m);
            }
        };
    }

    void after_jump() override { net.run(*this); }

    gossip_network& net;
    std::uint32_t run_number;
    std::string url;
    core::announcement said;
    std::uint64_t seq = 0;
    bool alive = true;
    time_point stopped_until = time_point::min();
    std::size_t unread = 0;
    time_point woken_at = time_point::max();
    std::size_t bytes = 0;
    core::suspend_detector away;
    core::counters counts;
    core::deadline_queue deadlines;
    core::membership others_known;
    core::gossip gossip;
    core::announcer announcer;
};

gossip_network::gossip_network(std::uint64_t seed, gossip_weather weather, planted fault)
    : dice_(seed), weather_(weather), fault_(fault) {}
gossip_network::~gossip_network() = default;

std::size_t gossip_network::start(std::size_t count, milliseconds within, std::size_t seeds) {
    const auto first = members_.size();
    std::vector<time_point> when;
    for (std::size_t i = 0; i < count; ++i) {
        const auto number = first + i;
        const auto m = std::make_shared<member>(*this, number, "vehicle-" + std::to_string(1000 + number),
                                                scattered(next_epoch_++));
        by_url_.emplace(m->url, number);
        if (seeds_.size() < seeds) {
            seeds_.push_back(m->url);
        }
        m->alive = false;
        members_.push_back(m);
        when.push_back(time_.now() + dice_.within(within));
    }
    std::sort(when.begin(), when.end());
    for (std::size_t i = 0; i < count; ++i) {
        pass(std::chrono::duration_cast<milliseconds>(when[i] - time_.now()));
        auto& m = *members_[first + i];
        m.alive = true;
        m.begin();
        wake(m);
        plan_pause(first + i, time_.now());
    }
    return first;
}

// -- time ----------------------------------------------------------------------------------------------------------

// Runs its timers when the next one is due.
void gossip_network::wake(member& m) {
    const auto next = m.deadlines.next();
    if (!m.alive || !next) {
        return;
    }
    m.away.expect(*next, m.now());
    const auto due = time_.now() + std::max(*next - m.now(), time_point::duration::zero());
    if (due < m.woken_at) {
        m.woken_at = due;
        m.at_true(due, [this, &m] {
            m.woken_at = m.woken_at <= time_.now() ? time_point::max() : m.woken_at;
            run(m);
        });
    }
}

void gossip_network::run(member& m, const handler& what) {
    if (!m.alive) {
        return;
    }
    const auto now = m.now();
    if (m.away.ended(now) && fault_ != planted::excuse_forgotten) {
        m.others_known.note_suspension(now);
    }
    m.deadlines.expire(now);
    if (what) {
        what(m);
    }
    wake(m);
}

gossip_network::milliseconds gossip_network::pass_until(const std::function<bool()>& holds, milliseconds limit) {
    constexpr milliseconds step{500};
    milliseconds took{0};
    while (took < limit) {
        pass(step);
        took += step;
        if (holds()) {
            break;
        }
    }
    return took;
}

// -- messages ------------------------------------------------------------------------------------------------------

void gossip_network::send(std::size_t from, std::size_t to, std::size_t bytes, handler arrives, handler refused) {
    if (passes_ && !passes_(from, to)) {
        return;
    }
    const auto way =
        weather_.quickest + dice_.within(weather_.slowest - weather_.quickest) + delay_by_loss(1 + bytes / segment);
    if (members_[to]->alive) {
        deliver(time_.now() + way, to, std::move(arrives));
    } else if (refused && (!passes_ || passes_(to, from))) { // no node runs there: the system rejects it
        deliver(time_.now() + way * 2, from, std::move(refused));
    }
}

void gossip_network::deliver(time_point when, std::size_t to, handler what) {
    time_.at(when, [this, to, what = std::move(what)] {
        auto& m = *members_[to];
        if (!m.alive) {
            return;
        }
        deepest_queue_ = std::max(deepest_queue_, ++m.unread);
        m.run([this, &m, what] {
            --m.unread;
            run(m, what);
        });
    });
}

// Lost data is sent again on streams and for requests by datagram alike, first after 200 ms, then at doubling
// intervals.
std::chrono::microseconds gossip_network::delay_by_loss(std::size_t packets) {
    std::chrono::microseconds delay{0};
    bool lost = false;
    for (std::size_t i = 0; i < packets && weather_.loss != 0; ++i) {
        lost |= dice_.chance(weather_.loss);
    }
    for (std::chrono::milliseconds pause{200}; lost; pause *= 2) {
        delay += pause;
        lost = dice_.chance(weather_.loss);
    }
    return delay;
}

// -- faults of nodes -----------------------------------------------------------------------------------------------

void gossip_network::kill(std::size_t node) { members_[node]->alive = false; }

void gossip_network::leave(std::size_t node) {
    members_[node]->gossip.stop(members_[node]->now());
    kill(node);
}

void gossip_network::restart(std::size_t node) {
    const auto& before = *members_[node];
    const auto next = std::make_shared<member>(*this, node, before.said.node, scattered(next_epoch_++));
    next->bytes = before.bytes;
    members_[node] = next;
    next->begin();
    wake(*next);
}

void gossip_network::pause(std::size_t node, std::chrono::microseconds span) {
    auto& m = *members_[node];
    m.stopped_until = time_.now() + span;
    m.freeze_for(span);
}

void gossip_network::jump(std::size_t node, milliseconds ahead) { members_[node]->jump(ahead); }

// Durations and intervals of pauses are chosen to make up their share of time.
void gossip_network::plan_pause(std::size_t node, time_point after) {
    if (weather_.paused == 0) {
        return;
    }
    const auto& w = weather_;
    const auto mean = (w.shortest_pause + w.max_pause) / 2;
    const auto apart = mean * (1000 - w.paused) / w.paused;
    const auto begins = after + dice_.within(apart * 2);
    const auto lasts = w.shortest_pause + dice_.within(w.max_pause - w.shortest_pause);
    time_.at(begins, [this, node, lasts] {
        pause(node, lasts);
        plan_pause(node, members_[node]->stopped_until);
    });
}

// -- results -------------------------------------------------------------------------------------------------------

std::size_t gossip_network::living() const {
    return static_cast<std::size_t>(
        std::count_if(members_.begin(), members_.end(), [](const auto& m) { return m->alive; }));
}

bool gossip_network::is_steady(const member& m) const { return m.alive && m.stopped_until + settles <= time_.now(); }

std::size_t gossip_network::missing() const {
    std::size_t lacking = 0;
    const auto all = static_cast<std::size_t>(
        std::count_if(members_.begin(), members_.end(), [&](const auto& m) { return is_steady(*m); }));
    for (const auto& m : members_) {
        if (!is_steady(*m)) {
            continue;
        }
        std::size_t known = 0;
        m->others_known.for_each([&](const core::membership::member& k) {
            const auto at = by_url_.find(k.where);
            if (at != by_url_.end()) {
                const auto& other = *members_[at->second];
                known += !k.suspect && is_steady(other) && k.epoch == other.run_number ? 1 : 0;
            }
        });
        lacking += all - 1 - known;
    }
    return lacking;
}

std::size_t gossip_network::listing(std::size_t node, bool suspect) const {
    return static_cast<std::size_t>(std::count_if(members_.begin(), members_.end(), [&](const auto& m) {
        const auto k = m->others_known.find_member(members_[node]->said.node);
        return m->alive && m != members_[node] && k && k->suspect == suspect;
    }));
}

gossip_network::received gossip_network::take_received(milliseconds within) {
    received r;
    const double seconds = std::chrono::duration<double>(within).count();
    for (const auto& m : members_) {
        const auto rate = static_cast<double>(std::exchange(m->bytes, 0)) / seconds;
        r.average += rate / static_cast<double>(members_.size());
        r.most = std::max(r.most, rate);
    }
    return r;
}

} // namespace cles::simulation
