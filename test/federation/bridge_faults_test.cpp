// SPDX-License-Identifier: BSL-1.0
#include "simulated_nats.hpp"
#include "support/amount.hpp"

#include <boost/test/unit_test.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace bridge_faults {
namespace {

using namespace std::chrono_literals;
using cles::bridging::test::simulated_nats;
using cles::bridging::test::site;

/// Two pools of two bridges, requests in both directions, and faults, until `end`.
class run {
  public:
    explicit run(std::uint32_t seed) : nats_(seed) {
        for (std::size_t i = 0; i < sites_.size(); ++i) {
            sites_[i] = std::make_unique<site>(nats_, i < 2 ? "north" : "south", "node" + std::to_string(i));
            sites_[i]->names =
                i < 2 ? std::vector<std::string>{"node0", "node1"} : std::vector<std::string>{"node2", "node3"};
            sites_[i]->answer_after = std::chrono::milliseconds{draw(0, 60)};
            sites_[i]->connect();
        }
        nats_.run_for(2s);
    }

    void with_faults() {
        nats_.impair() = {.longest_delay = std::chrono::microseconds{draw(0, 20'000)},
                          .loss = 0.01 * draw(0, 5),
                          .repetition = 0.01 * draw(0, 10)};
        for (int step = 0; step < 300; ++step) {
            ask();
            if (draw(0, 19) == 0) {
                fault();
            }
            nats_.run_for(std::chrono::milliseconds{draw(0, 30)});
        }
    }
    void heal() {
        nats_.impair() = {};
        for (const auto& each : sites_) {
            if (each->connection() == 0) {
                each->connect();
            }
        }
        nats_.run_for(10s);
    }
    void check() {
        std::map<std::string, int> effects;
        for (const auto& each : sites_) {
            for (const auto& [body, times] : each->executed) {
                effects[body] += times;
            }
        }
        for (const auto& [body, times] : effects) {
            BOOST_TEST(times == 1, body << " ran " << times << " times");
        }
        for (const auto& r : asked_) {
            const auto& answers = sites_[r.by]->answers[r.id];
            BOOST_TEST(answers.size() <= 1U, r.body << " has " << answers.size() << " answers");
            if (!answers.empty() && !answers[0].starts_with("{\"error\"")) {
                BOOST_TEST(answers[0] == r.body);
                BOOST_TEST(effects[r.body] == 1);
            }
        }
        for (const auto& each : sites_) {
            BOOST_TEST(each->core().is_live("north"));
            BOOST_TEST(each->core().is_live("south"));
        }
    }
    void check_that_all_is_well_again() {
        asked_.clear();
        for (int i = 0; i < 20; ++i) {
            ask();
        }
        nats_.run_for(1s);
        for (const auto& r : asked_) {
            if (!r.is_cancelled) {
                BOOST_TEST(sites_[r.by]->answer(r.id) == r.body);
            }
        }
    }

  private:
    struct request {
        std::size_t by;
        std::uint64_t id;
        std::string body;
        bool is_cancelled;
    };

    int draw(int least, int most) { return std::uniform_int_distribution<int>{least, most}(nats_.random()); }

    void ask() {
        const auto by = static_cast<std::size_t>(draw(0, 3));
        const std::string pool = by < 2 ? "south" : "north";
        const auto& node = by < 2 ? "node2" : "node1";
        if (sites_[by]->connection() == 0) {
            return;
        }
        const auto body = "{\"n\":" + std::to_string(++last_) + "}";
        const auto id = sites_[by]->ask(pool, std::string{"DELEGATE "} + node + ":echo deadline=3000 " + body);
        const bool cancels = draw(0, 9) == 0;
        if (cancels) {
            sites_[by]->cancel(pool, id);
        }
        asked_.push_back({by, id, body, cancels});
    }
    // Ids begin anew after a restart of the node, so what was asked before is not compared.
    void fault() {
        const auto which = static_cast<std::size_t>(draw(0, 3));
        auto& s = *sites_[which];
        switch (draw(0, 2)) {
        case 0:
            if (s.connection() != 0) {
                s.disconnect();
            }
            break;
        case 1: s.restart(); break;
        default: break;
        }
        if (s.connection() == 0 && draw(0, 1) == 0) {
            s.connect();
        }
        for (const auto& each : sites_) {
            if (each->connection() == 0 && draw(0, 2) == 0) {
                each->connect();
            }
        }
    }

    simulated_nats nats_;
    std::array<std::unique_ptr<site>, 4> sites_;
    std::vector<request> asked_;
    std::uint64_t last_ = 0;
};

} // namespace
} // namespace bridge_faults

BOOST_AUTO_TEST_SUITE(bridge_faults)

BOOST_AUTO_TEST_CASE(no_effect_happens_twice_whatever_is_lost) {
    for (std::uint32_t seed = 1; seed <= cles::test::amount(200U, 40U); ++seed) {
        BOOST_TEST_CONTEXT("seed " << seed) {
            run all{seed};
            all.with_faults();
            all.heal();
            all.check();
            all.check_that_all_is_well_again();
        }
    }
}

BOOST_AUTO_TEST_SUITE_END()
