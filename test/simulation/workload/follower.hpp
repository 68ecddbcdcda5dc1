// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>

#include "node/publish/feed_machine.hpp"
#include "simulation/workload/feed_reader.hpp"
#include "simulation/world/node_run.hpp"

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

namespace cles::simulation {

/// A feed of a simulated program, that keeps account of what comes.
class follower final : public feed_reader {
  public:
    /// `to`: the host of the publisher, whose URL is in the terms.
    follower(node_run& at, std::uint32_t label, unsigned to, core::feed_terms terms, std::string target,
             std::string path, std::chrono::milliseconds slow);
    ~follower() override { leave(); }

    void start();
    void close();

    [[nodiscard]] unsigned to() const noexcept { return to_; }
    [[nodiscard]] const std::string& path() const noexcept { return machine_.path(); }
    [[nodiscard]] bool is_thinned() const noexcept { return terms_.every_ms != 0; }
    /// It was bound and has not been closed: it is to receive what is published.
    [[nodiscard]] bool is_open() const noexcept { return has_begun() && !machine_.closed(); }
    [[nodiscard]] std::uint64_t seen() const noexcept { return seen_; }
    /// The last update that it was given, or told to have missed.
    [[nodiscard]] published_mark last() const noexcept { return last_; }
    [[nodiscard]] std::string name() const override;

  private:
    class first_answer;

    core::feed_mailbox& mail() override { return machine_.mail(); }
    void on_event(const detail::raw_event& event) override;
    void on_update(const detail::raw_event& event);
    void leave();

    unsigned to_;
    core::feed_terms terms_;
    core::feed_machine machine_;
    published_mark last_;
    std::uint64_t missed_ = 0; // told since then
    std::uint64_t seen_ = 0;
    bool left_ = false;
};

} // namespace cles::simulation
