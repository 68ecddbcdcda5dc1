// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>

#include "core/feed_machine.hpp"
#include "simulation/feed_ties.hpp"
#include "simulation/node_run.hpp"

#include <cstdint>
#include <memory>
#include <string>

namespace cles::simulation {

/// What a published body says of itself.
struct published_mark {
    std::uint64_t number = 0; ///< of its noun, from 1; 0 where it says nothing
    unsigned run = 0;         ///< of the publisher
};
[[nodiscard]] published_mark mark_of(std::string_view json);

/// A feed of a simulated program: fetches what comes, quickly or slowly, and keeps account of it.
class follower final : public std::enable_shared_from_this<follower> {
  public:
    follower(node_run& at, std::uint32_t label, feed_terms terms, std::string target, std::string path,
             std::chrono::milliseconds slow);

    void start();
    /// Does not fetch for so long.
    void hold(std::chrono::milliseconds time);
    void close();

    [[nodiscard]] std::uint32_t label() const noexcept { return label_; }
    [[nodiscard]] node_run& at() noexcept { return node_; }
    [[nodiscard]] const feed_terms& terms() const noexcept { return terms_; }
    [[nodiscard]] const std::string& path() const noexcept { return machine_.path(); }
    [[nodiscard]] bool is_thinned() const noexcept { return terms_.every_ms != 0; }
    /// It was bound and has not been closed: it is to receive what is published.
    [[nodiscard]] bool is_open() const noexcept { return bound_ && !machine_.closed(); }
    [[nodiscard]] std::uint64_t seen() const noexcept { return seen_; }
    /// The last update that it was given, or told to have missed.
    [[nodiscard]] published_mark last() const noexcept { return last_; }
    [[nodiscard]] std::string name() const;

  private:
    class first_answer;
    class next_event;

    void fetch();
    void on_event(const detail::raw_event& event);
    void on_update(const detail::raw_event& event);
    void complain(rule which, const std::string& what) { node_.watcher().broken(which, name() + " " + what); }

    node_run& node_;
    std::uint32_t label_;
    feed_terms terms_;
    std::chrono::milliseconds slow_;
    core::feed_machine machine_;
    published_mark last_;
    std::uint64_t missed_ = 0; // told since then
    std::uint64_t seen_ = 0;
    bool bound_ = false;
    bool waits_ = false;
    bool held_ = false;
    bool fetch_planned_ = false;
};

} // namespace cles::simulation
