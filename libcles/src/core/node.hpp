// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/json_writer.hpp>
#include <cles/limits.hpp>
#include <cles/log.hpp>

#include "core/completion_queue.hpp"
#include "core/counters.hpp"
#include "core/deadlines.hpp"
#include "core/dedup.hpp"
#include "core/latency_histogram.hpp"
#include "core/memory_budget.hpp"
#include "core/presence.hpp"
#include "core/publications.hpp"
#include "core/reflection_limit.hpp"
#include "core/registry.hpp"
#include "port/clock.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

class gossip_answers;

/// How a node begins.
struct node_setup {
    std::string name;
    std::string pool{};                  ///< empty: the one without a name
    std::uint32_t epoch = 0;             ///< drawn at random for each run
    std::uint64_t first_datagram_id = 0; ///< likewise; what ids count from in requests by datagram
    cles::limits bounds{};
    authoriser authorise{};
    log_sink log{};
    std::function<void(json_writer&)> metrics{}; ///< what the program counts
    std::function<node_load()> load{};           ///< how much it has to do; empty: its handlers that run
    completion_queue::runner complete{};         ///< how completions are called
};

class router;

/// What all sessions of a node share.
struct node {
    /// `wake` asks for `publications::drain` soon.
    node(node_setup setup, const core::clock& source, std::function<void()> wake);

    const std::string name;
    const std::string epoch;
    const std::uint64_t first_datagram_id;
    const cles::limits bounds;
    const authoriser authorise;
    const log_sink log;
    const std::function<void(json_writer&)> metrics;
    const std::function<node_load()> load;
    const core::clock& time;
    const time_point started;

    completion_queue completions;
    std::vector<std::string> endpoints;
    memory_budget memory;                                ///< of what is held for peers
    const std::shared_ptr<memory_account> kept_values;   ///< last values, and updates that are queued
    const std::shared_ptr<memory_account> kept_requests; ///< of this node's own and of clients, which wait for a link
    registry tasks;
    deadline_queue deadlines;
    presence others;
    gossip_answers* talk = nullptr; ///< to those who take part in gossip; null where this node does not
    counters counts;
    latency_histogram handler_time; ///< of all handlers that answer later, and of a sample of the others
    std::uint64_t plain_runs = 0;   ///< of those others, to choose the sample by
    publications published;
    dedup_memory remembered;
    reflection_limit reflection;
    std::uint64_t next_id = 1; ///< of requests that this node sends
    router* way = nullptr;     ///< what serves requests for `any`, `all` and other nodes; null: nothing does

    // What the user's functions throw stays inside these.
    [[nodiscard]] node_load load_now() const noexcept;
    void say(log_level level, const log_entry& what) const noexcept;
    /// The same from inside a loop over what the log's reader could change.
    void say_soon(log_level level, std::string what, std::string peer = {});
};

/// What it offers: the value of `tasks` in the reply to `PULL self:cles`.
void write_tasks(json_writer& w, const node& n);
/// Writes the reply to `PULL self:cles`.
void write_description(json_writer& w, const node& n);
/// Writes the reply to `PULL self:cles/metrics`.
void write_metrics(json_writer& w, const node& n);

} // namespace cles::core
