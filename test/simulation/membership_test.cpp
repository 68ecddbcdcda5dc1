// SPDX-License-Identifier: BSL-1.0
// Networks of hundreds of nodes that announce themselves, in virtual time, over a group that loses some datagrams.

#include "node/membership/discovery.hpp"
#include "node/membership/membership.hpp"
#include "simulation/seeds.hpp"
#include "support/manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <chrono>
#include <memory>
#include <random>
#include <string>
#include <vector>

BOOST_AUTO_TEST_SUITE(membership)

using namespace std::chrono_literals;
using cles::time_point;
using cles::core::announcement;

namespace {

class network {
  public:
    explicit network(std::size_t count, double loss = 0) : loss_(loss) {
        for (std::size_t i = 0; i < count; ++i) {
            start("node" + std::to_string(i));
            pass(3ms);
        }
    }

    struct member final : cles::core::announcer::sender {
        member(network& n, std::string called, std::uint32_t number)
            : owner(n), said{.node = std::move(called), .endpoints = {"tcp://0.0.0.0:25370"}},
              epoch(number), from{0x0A000000U + number, 40000}, others_known(said.node, number, n.deadlines_, 2000),
              announcer(*this, n.deadlines_, number * 7919) {}

        void announce(std::chrono::milliseconds interval) override {
            said.interval = interval;
            owner.deliver(*this);
        }
        [[nodiscard]] std::size_t others() const override { return others_known.size(); }
        [[nodiscard]] std::size_t count(cles::peer_state state) const {
            const auto all = others_known.list(owner.clock_.now());
            return static_cast<std::size_t>(
                std::count_if(all.begin(), all.end(), [&](const auto& p) { return p.state == state; }));
        }

        network& owner;
        announcement said;
        std::uint32_t epoch;
        std::uint64_t seq = 0;
        cles::core::group_source from;
        bool alive = true;
        cles::core::membership others_known;
        cles::core::announcer announcer;
    };

    member& start(std::string name) {
        auto& made = *members_.emplace_back(std::make_unique<member>(*this, std::move(name), next_++));
        for (const auto& other : members_) { // BIND all:cles
            if (other->alive && other.get() != &made && arrives()) {
                other->announcer.solicited(clock_.now());
            }
        }
        made.announcer.start(clock_.now());
        return made;
    }
    void kill(member& m) {
        m.alive = false;
        m.announcer.stop();
    }
    void stop(member& m) {
        m.said.leaving = true;
        deliver(m);
        kill(m);
    }
    void pass(std::chrono::milliseconds by) {
        const auto end = clock_.now() + by;
        for (auto next = deadlines_.next(); next && *next <= end; next = deadlines_.next()) {
            clock_.advance(std::max(*next - clock_.now(), cles::time_point::duration::zero()));
            deadlines_.expire(clock_.now());
        }
        clock_.advance(end - clock_.now());
    }
    [[nodiscard]] std::size_t announced_within(std::chrono::milliseconds span) {
        const auto before = announced_;
        pass(span);
        return announced_ - before;
    }
    [[nodiscard]] std::vector<member*> living() const {
        std::vector<member*> all;
        for (const auto& m : members_) {
            if (m->alive) {
                all.push_back(m.get());
            }
        }
        return all;
    }

  private:
    bool arrives() { return loss_ == 0 || std::uniform_real_distribution<>{}(chance_) >= loss_; }
    void deliver(member& m) {
        ++announced_;
        ++m.seq;
        for (const auto& other : members_) {
            if (other->alive && other.get() != &m && arrives()) {
                other->others_known.apply_announcement(m.said, m.epoch, m.seq, m.from, clock_.now());
            }
        }
    }

    double loss_;
    std::mt19937 chance_{4711};
    cles::test::manual_clock clock_;
    cles::core::deadline_queue deadlines_;
    std::vector<std::unique_ptr<member>> members_;
    std::uint32_t next_ = 1;
    std::size_t announced_ = 0;
};

} // namespace

BOOST_AUTO_TEST_CASE(what_a_node_hears_stays_level_as_the_network_grows) {
    network small{50};
    network large{cles::simulation::announced_nodes};
    for (auto* each : {&small, &large}) {
        each->pass(20s);
        for (const auto* m : each->living()) {
            BOOST_TEST(m->count(cles::peer_state::live) == each->living().size() - 1);
        }
    }
    // An interval of 1 s, or of 10 ms for each node; each up to a quarter shorter.
    const auto of_small = small.announced_within(12s);
    BOOST_TEST(of_small >= 600U);
    BOOST_TEST(of_small <= 800U);
    const auto of_large = large.announced_within(12s);
    BOOST_TEST(of_large >= 1200U);
    BOOST_TEST(of_large <= 1600U);
}

BOOST_AUTO_TEST_CASE(a_newcomer_knows_all_when_its_first_round_is_over_and_all_know_it) {
    network net{200};
    net.pass(20s);
    const auto& newcomer = net.start("newcomer");
    net.pass(cles::core::discovery_grace::length);
    BOOST_TEST(newcomer.others_known.size() == 200U);
    for (const auto* m : net.living()) {
        BOOST_TEST((m == &newcomer || m->others_known.address_of("newcomer").has_value()));
    }
}

BOOST_AUTO_TEST_CASE(where_a_tenth_of_it_is_lost_nobody_is_taken_for_gone) {
    network net{100, 0.1};
    net.pass(10s);
    std::size_t silent = 0;
    for (int i = 0; i < 10; ++i) {
        net.pass(5s);
        for (const auto* m : net.living()) {
            BOOST_TEST(m->others_known.size() == 99U);
            BOOST_TEST(m->count(cles::peer_state::clash) == 0U);
            silent += m->count(cles::peer_state::suspect);
        }
    }
    BOOST_TEST(silent < 99'000U / 200); // of 99,000 checks of a neighbour
}

BOOST_AUTO_TEST_CASE(the_dead_are_suspect_then_gone_and_those_who_leave_are_gone_at_once) {
    network net{150};
    net.pass(20s);
    const auto all = net.living();
    for (std::size_t i = 0; i < 50; ++i) {
        net.kill(*all[i]);
        net.stop(*all[50 + i]);
    }
    for (const auto* m : net.living()) {
        BOOST_TEST(m->others_known.size() == 99U); // 49, and the 50 that sent nothing
    }
    net.pass(5250ms); // 3.5 intervals of 1.5 s
    for (const auto* m : net.living()) {
        BOOST_TEST(m->count(cles::peer_state::suspect) == 50U);
    }
    net.pass(17'250ms); // 15 intervals
    for (const auto* m : net.living()) {
        BOOST_TEST(m->others_known.size() == 49U);
        BOOST_TEST(m->count(cles::peer_state::live) == 49U);
    }
}

BOOST_AUTO_TEST_CASE(all_killed_and_started_again_are_found_anew_without_a_clash) {
    network net{60};
    net.pass(10s);
    for (auto* m : net.living()) {
        const auto name = m->said.node;
        net.kill(*m);
        net.start(name);
        net.pass(50ms);
    }
    net.pass(5s);
    for (const auto* m : net.living()) {
        BOOST_TEST(m->others_known.size() == 59U);
        BOOST_TEST(m->count(cles::peer_state::live) == 59U);
        for (const auto& p : m->others_known.list(time_point{})) {
            BOOST_TEST(p.epoch > "0000003c"); // of the second incarnations
        }
    }
}

BOOST_AUTO_TEST_SUITE_END()
