// SPDX-License-Identifier: BSL-1.0
// A link of the `cles` command that is logged (`-vv`) behaves exactly as the link that it wraps.

#include <cles/link.hpp>

#include "client/wire_log.hpp"
#include "support/data_test_case.hpp"
#include "support/link_pair.hpp"

#include <boost/test/unit_test.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace wire_log {
namespace {

using namespace cles::test;

/// Records the calls that it receives.
struct told_link final : cles::link {
    void start(std::shared_ptr<cles::link_events> owner) override {
        asked.emplace_back("start");
        events = std::move(owner);
    }
    std::string& output() override { return text; }
    std::string& urgent_output() override { return urgent; }
    [[nodiscard]] std::size_t datagram() const noexcept override { return 1234; }
    void flush() override { asked.push_back("flush " + std::exchange(urgent, {}) + std::exchange(text, {})); }
    [[nodiscard]] std::size_t unsent() const noexcept override { return 100 + text.size() + urgent.size(); }
    [[nodiscard]] std::uint64_t sent() const noexcept override { return 11; }
    [[nodiscard]] std::uint64_t received() const noexcept override { return 12; }
    void pause(bool stop) override { asked.emplace_back(stop ? "pause" : "go on"); }
    void finish() override { asked.emplace_back("finish"); }
    void close() override {
        asked.emplace_back("close");
        events.reset();
    }
    [[nodiscard]] std::size_t buffered() const noexcept override { return 50'000; }
    void shrink() override { asked.emplace_back("shrink"); }
    [[nodiscard]] const cles::identity& peer() const noexcept override { return who; }

    std::vector<std::string> asked;
    std::string text;
    std::string urgent;
    cles::identity who{.transport = "tcp", .address = "tcp://127.0.0.1:7", .name = {}, .uid = {}};
    std::shared_ptr<cles::link_events> events;
};

struct fixture {
    std::vector<std::string> entries;
    std::shared_ptr<told_link> inside = std::make_shared<told_link>();
    cles::link_ptr outside = tool::logged(
        inside, "tcp://127.0.0.1:7", [this](cles::log_level, const auto& what) { entries.emplace_back(what.text); });
};

} // namespace
} // namespace wire_log

BOOST_AUTO_TEST_SUITE(wire_log)

BOOST_FIXTURE_TEST_CASE(every_call_is_forwarded_to_the_wrapped_link, fixture) {
    const auto owner = std::make_shared<link_recorder>();
    outside->start(owner);
    outside->pause(true);
    outside->pause(false);
    outside->output().append("PULL car1:speed\n");
    outside->urgent_output().append("PULL car1:now urgent=yes\n");
    BOOST_TEST(outside->unsent() == 100U + 16U + 25U);
    outside->flush();
    BOOST_TEST(outside->unsent() == 100U);
    outside->shrink();
    outside->output().append("{}\n");
    outside->finish();
    BOOST_TEST(inside->text == "{}\n");
    outside->close();
    BOOST_TEST(inside->asked == (std::vector<std::string>{"start", "pause", "go on",
                                                          "flush PULL car1:now urgent=yes\nPULL car1:speed\n", "shrink",
                                                          "finish", "close"}),
               boost::test_tools::per_element());
    BOOST_TEST(outside->datagram() == 1234U);
    BOOST_TEST(outside->sent() == 11U);
    BOOST_TEST(outside->received() == 12U);
    BOOST_TEST(outside->buffered() >= 50'000U);
    BOOST_TEST(&outside->peer() == &inside->who);
}

BOOST_FIXTURE_TEST_CASE(what_it_holds_itself_counts_and_is_given_back, fixture) {
    outside->output().append(std::string(100'000, 'x') + "\n");
    BOOST_TEST(outside->buffered() > 150'000U);
    outside->shrink();
    BOOST_TEST(outside->buffered() > 150'000U); // nothing of it has been sent
    outside->flush();
    outside->shrink();
    BOOST_TEST(outside->buffered() < 51'000U);
}

CLES_DATA_TEST_CASE(an_idle_link_gives_back_what_a_large_line_took, every_socket, kind) {
    link_pair pair{kind};
    pair.connect();
    std::size_t lines = 0;
    const auto count = [&](cles::log_level, const cles::log_entry&) { ++lines; };
    for (auto* end : {&pair.near, &pair.far}) {
        end->link = tool::logged(end->link, "there", count);
        end->start();
    }
    const auto large = std::string(1'000'000, 'x') + "\n";
    pair.near.say(large);
    pair.until([&] { return pair.far.lines() == 1; });
    pair.far.say(large);
    pair.until([&] { return pair.near.lines() == 1; });
    BOOST_TEST(lines == 4U);
    pair.near.link->shrink();
    pair.far.link->shrink();
    pair.until([&] { return pair.near.link->buffered() < 5'000 && pair.far.link->buffered() < 5'000; });
    pair.near.say("more\n");
    pair.until([&] { return pair.far.lines() == 2; });
}

BOOST_AUTO_TEST_SUITE_END()
