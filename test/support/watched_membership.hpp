// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "manual_clock.hpp"
#include "node/membership/membership.hpp"

#include <boost/test/unit_test.hpp>

#include <chrono>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::test {

/// A membership table with its own time, which records what it reports.
struct watched_membership : core::membership::watcher {
    using change = core::membership::change;
    using verdict = core::membership::verdict;

    watched_membership() { table.watch(this); }

    void on_peer(std::string_view node, change what, std::string_view where) override {
        static constexpr const char* words[] = {"appeared", "moved", "silent", "returned",
                                                "left",     "gone",  "clash",  "taken"};
        changes.push_back(std::string{node} + " " + words[static_cast<int>(what)] +
                          (where.empty() ? std::string{} : " " + std::string{where}));
    }
    std::vector<std::string> take_changes() { return std::exchange(changes, {}); }

    void pass(std::chrono::milliseconds by) {
        clock.advance(by);
        deadlines.expire(clock.now());
    }
    [[nodiscard]] std::string where(std::string_view node) const {
        const auto found = table.address_of(node);
        return found ? std::string{*found} : "nowhere";
    }
    [[nodiscard]] std::vector<peer> list() const { return table.list(clock.now()); }

    static void check(const std::vector<std::string>& changes, const std::vector<std::string>& expected) {
        BOOST_TEST(changes == expected, boost::test_tools::per_element());
    }

    std::vector<std::string> changes;
    manual_clock clock;
    core::deadline_queue deadlines;
    core::membership table{"me", 0xAAAA, deadlines, 5};
};

} // namespace cles::test
