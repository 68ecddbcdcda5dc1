// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/presence.hpp"
#include "manual_clock.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::test {

/// A table of nodes with its time, which writes down what it reports.
struct watched_presence : core::presence::watcher {
    using neighbours = core::presence;
    using change = neighbours::change;
    using verdict = neighbours::verdict;

    watched_presence() { table.watch(this); }

    void on_peer(std::string_view node, change what, std::string_view where) override {
        static constexpr const char* words[] = {"appeared", "moved", "silent", "returned",
                                                "left",     "gone",  "clash",  "taken"};
        told.push_back(std::string{node} + " " + words[static_cast<int>(what)] +
                       (where.empty() ? std::string{} : " " + std::string{where}));
    }
    std::vector<std::string> take_told() { return std::exchange(told, {}); }

    void pass(std::chrono::milliseconds by) {
        clock.advance(by);
        deadlines.expire(clock.now());
    }
    [[nodiscard]] std::string where(std::string_view node) const {
        const auto found = table.find(node);
        return found ? std::string{*found} : "nowhere";
    }
    [[nodiscard]] std::vector<peer> list() const { return table.list(clock.now()); }

    static void check(const std::vector<std::string>& told, const std::vector<std::string>& expected) {
        BOOST_TEST(told == expected, boost::test_tools::per_element());
    }

    std::vector<std::string> told;
    manual_clock clock;
    core::deadline_queue deadlines;
    neighbours table{"me", 0xAAAA, deadlines, 5};
};

} // namespace cles::test
