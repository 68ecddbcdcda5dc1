// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/counters.hpp"
#include "core/peer_table.hpp"
#include "core/presence.hpp"
#include "core/teller.hpp"
#include "protocol/message.hpp"

#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace cles::core {

/// Takes over what a table says, and keeps in mind what it lacks.
class gossip_intake final : public table_reader {
  public:
    /// `interval`: of this node, for entries that name none.
    gossip_intake(presence& into, counters& counts, std::chrono::milliseconds interval, teller by, time_point asked,
                  time_point now)
        : into_(into), counts_(counts), interval_(interval), by_(std::move(by)), asked_(asked), now_(now) {}

    void on_report(const peer_report& report) override {
        const bool was_known = into_.look(report.said.node).has_value();
        if (count(take(report)) == presence::verdict::taken && !was_known && !report.said.leaving) {
            newcomer_ = report.said.node;
        }
    }
    void on_beat(const peer_beat& beat) override {
        const auto verdict = count(into_.be_told(beat, asked_, now_));
        if (verdict == presence::verdict::unknown && missing_.size() < protocol::most_described) {
            missing_.push_back(beat.epoch);
        }
    }
    void on_bad_entry() override { ++counts_.entries_dropped; }

    /// The last of those that were not known; empty where all were.
    [[nodiscard]] const std::string& newcomer() const noexcept { return newcomer_; }
    /// Runs of which only beats have come.
    [[nodiscard]] const std::vector<std::uint32_t>& missing() const noexcept { return missing_; }

  private:
    presence::verdict take(const peer_report& report) {
        if (report.has_interval) {
            return into_.be_told(report, by_, asked_, now_);
        }
        auto whole = report;
        whole.said.interval = interval_;
        return into_.be_told(whole, by_, asked_, now_);
    }
    presence::verdict count(presence::verdict v) {
        counts_.peers_refused += v == presence::verdict::refused ? 1 : 0;
        return v;
    }

    presence& into_;
    counters& counts_;
    std::chrono::milliseconds interval_;
    teller by_;
    time_point asked_;
    time_point now_;
    std::string newcomer_;
    std::vector<std::uint32_t> missing_;
};

} // namespace cles::core
