// SPDX-License-Identifier: BSL-1.0
#include "nats/pool_link.hpp"

#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace link_backlog {
namespace {

using cles::nats::pool_link;
using role = cles::bridging::bridge_link::role;

class recorded_owner final : public cles::nats::pool_link_owner {
  public:
    void on_line(const cles::bridging::bridge_link&, std::string_view line) override { give(line.size() + 1); }
    void schedule(std::shared_ptr<pool_link> which) override { ready.push_back(std::move(which)); }
    void on_flushed() override {}
    void on_closed(pool_link&) override {}
    [[nodiscard]] std::size_t unsent() const override { return waiting; }
    [[nodiscard]] std::uint64_t given() const override { return all; }
    void give(std::size_t bytes) {
        waiting += bytes;
        all += bytes;
    }

    std::size_t waiting = 0;
    std::uint64_t all = 0;
    std::vector<std::shared_ptr<pool_link>> ready;
};

class recorded_node final : public cles::link_events {
  public:
    void on_line(std::string_view) override { ++lines; }
    void on_overlong(std::string_view) override {}
    void on_batch() override {}
    void on_end() override {}
    void on_lost(boost::system::error_code) override {}
    void on_writable() override {}

    int lines = 0;
};

struct fixture {
    std::shared_ptr<pool_link> make(role what) {
        auto made = std::make_shared<pool_link>(owner, cles::bridging::bridge_link{what, "north"}, "south");
        made->start(node);
        return made;
    }

    std::shared_ptr<recorded_owner> owner = std::make_shared<recorded_owner>();
    std::shared_ptr<recorded_node> node = std::make_shared<recorded_node>();
};

} // namespace
} // namespace link_backlog

BOOST_AUTO_TEST_SUITE(link_backlog)

BOOST_FIXTURE_TEST_CASE(a_paused_link_says_when_enough_waits_for_the_node, fixture) {
    const auto link = make(role::from_pool);
    link->pause(true);
    const std::string line(1'000, 'x');
    int delivered = 0;
    for (; !link->is_full() && delivered < 10'000; ++delivered) {
        link->deliver(line);
    }
    BOOST_TEST(link->is_full());
    BOOST_TEST(delivered > 900);
    BOOST_TEST(delivered < 1'100);
    link->hand_over();
    BOOST_TEST(node->lines == 0);
    BOOST_TEST(link->is_full());

    link->pause(false);
    while (node->lines < delivered) {
        const auto before = node->lines;
        link->hand_over();
        BOOST_REQUIRE(node->lines > before);
    }
    BOOST_TEST(!link->is_full());
}

BOOST_FIXTURE_TEST_CASE(a_backlog_counts_on_the_links_that_have_written_it, fixture) {
    const auto busy = make(role::from_pool);
    const auto quiet = make(role::to_pool);
    const auto write = [](const std::shared_ptr<pool_link>& on, std::size_t bytes) {
        on->output().append(bytes - 1, 'x').push_back('\n');
        on->flush();
    };
    write(quiet, 100);
    write(busy, 300'000);
    write(quiet, 100);
    write(busy, 100'000);
    BOOST_TEST(quiet->unsent() == 200U);
    BOOST_TEST(busy->unsent() == 400'200U - pool_link::capacity);
    BOOST_TEST(quiet->sent() == 0U);

    owner->waiting -= 100; // the first line of `quiet`
    BOOST_TEST(quiet->unsent() == 100U);
    BOOST_TEST(quiet->sent() == 100U);
    owner->waiting -= 300'050; // all of the second, and half of the third
    BOOST_TEST(quiet->unsent() == 50U);
    owner->waiting -= 50;
    BOOST_TEST(quiet->unsent() == 0U);
    BOOST_TEST(quiet->sent() == 200U);
    BOOST_TEST(busy->unsent() == 100'000U - pool_link::capacity);
    owner->waiting = 0;
    BOOST_TEST(busy->unsent() == 0U);
    BOOST_TEST(busy->sent() == 400'000U);
}

BOOST_AUTO_TEST_SUITE_END()
