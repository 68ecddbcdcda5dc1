// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/pending.hpp>

#include "simulation/network/agenda.hpp"
#include "simulation/world/witness.hpp"
#include "simulation/world/work_report.hpp"

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace cles::simulation {

/// The requests of simulated clients: how often each has run and ended, and with what. Checks that each ends once and
/// in time, that it does not run more often than it may, and that its reply is true.
class ledger {
  public:
    static constexpr unsigned any_number = ~0U;

    struct entry {
        unsigned most_runs = 1;      ///< on all nodes together
        bool vital = false;          ///< has to succeed
        bool may_be_refused = false; ///< though it is vital, because all are busy
        time_point deadline{};
        unsigned ran = 0;
        unsigned ends = 0;
        bool succeeded = false;
        errc code{}; ///< why it failed
        std::string why{};
    };

    ledger(witness& watcher, const agenda& time) noexcept : watcher_(watcher), time_(time) {}

    /// Returns the number of the request, from 1.
    std::uint32_t add(entry what);
    [[nodiscard]] std::size_t size() const noexcept { return entries_.size(); }
    [[nodiscard]] const entry& of(std::uint32_t op) const { return entries_.at(op - 1); }
    void note_run(std::uint32_t op) { ++entries_.at(op - 1).ran; }
    /// Records the end of that request. \param then called afterwards; may be null
    detail::pending_ptr operation(std::uint32_t op, std::function<void()> then = {});

    /// All should have ended.
    void judge() const;
    [[nodiscard]] request_tally tally() const;
    void complain(rule which, std::uint32_t op, const std::string& what) const {
        watcher_.broken(which, "request " + std::to_string(op) + " " + what);
    }

  private:
    void end(std::uint32_t op, const entry& how, const std::function<void()>& then);

    witness& watcher_;
    const agenda& time_;
    std::vector<entry> entries_;
};

} // namespace cles::simulation
