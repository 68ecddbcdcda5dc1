// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/json_writer.hpp>
#include <cles/limits.hpp>
#include <cles/log.hpp>

#include "node/base/completion_queue.hpp"
#include "node/base/deadlines.hpp"
#include "node/base/memory_budget.hpp"
#include "node/base/metrics.hpp"
#include "node/membership/membership.hpp"
#include "node/publish/publications.hpp"
#include "node/session/datagram_rules.hpp"
#include "node/session/task_execution.hpp"
#include "port/environment.hpp"
#include "port/log_budget.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::detail {
struct jobs_part;
struct tracing_part;
struct types_part;
} // namespace cles::detail

namespace cles::core {

class gossip;
class job_table;
class node_security;
class other_pools;
class request_sharing;
class security_protocol;
class span_recorder;

struct node_state;

/// A line of the log that others can cause.
struct caused_line {
    log_level level = log_level::info;
    std::string_view kind;     ///< one of a few literals
    std::string_view source{}; ///< who has caused it: a member, or a host; empty: nobody can be named
    std::string_view peer{};   ///< as `log_entry::peer`
    std::uint32_t most = 1;    ///< such lines a minute
};

/// The settings of a node.
struct node_options {
    std::string name;
    std::string pool{};                  ///< empty: the pool without a name
    std::uint32_t epoch = 0;             ///< random for each incarnation; 0: the node draws it
    std::uint64_t first_datagram_id = 0; ///< likewise; request ids by datagram count from here
    cles::limits bounds{};
    authoriser authorise{};
    std::shared_ptr<node_security> security{}; ///< null: the node is not secured
    /// Creates what a secured node says; null only without `security`.
    std::unique_ptr<security_protocol> (*secured)(node_state& host) = nullptr;
    other_pools* pools = nullptr;                  ///< owned by `metrics`; null: the node reaches its own pool only
    const detail::tracing_part* tracing = nullptr; ///< null: nothing is recorded of traced requests
    const detail::types_part* types = nullptr;     ///< null: the types of its tasks are not told
    const detail::jobs_part* jobs = nullptr;       ///< null: its jobs are not listed
    log_sink log{};
    std::function<void(json_writer&)> metrics{}; ///< metrics of the program
    std::function<node_load()> load{};           ///< load of the program; empty: its running handlers
    completion_queue::runner complete{};         ///< runs completions
};

class router;

/// The state that all sessions of a node share.
struct node_state {
    /// `wake` schedules a call of `send_updates`.
    node_state(node_options setup, const core::clock& source, const std::function<void()>& wake);
    node_state(const node_state&) = delete;
    node_state& operator=(const node_state&) = delete;
    ~node_state();

    const std::string name;
    const std::string epoch;
    const std::uint64_t first_datagram_id;
    const cles::limits bounds;
    const authoriser authorise;
    const std::shared_ptr<node_security> security;
    other_pools* const pools;
    const log_sink log;
    const std::function<void(json_writer&)> metrics;
    const std::function<node_load()> load;
    const core::clock& time;
    const time_point started;

    completion_queue completions;
    std::vector<std::string> endpoints;
    memory_budget memory;                                ///< of what is held for peers
    const std::shared_ptr<memory_account> kept_values;   ///< last values and queued updates
    const std::shared_ptr<memory_account> kept_requests; ///< of this node and of clients, waiting for a link
    task_registry tasks;
    deadline_queue deadlines;
    membership peers;
    gossip* gossip_responder = nullptr; ///< answers gossip requests; null if this node does not gossip
    request_sharing* sharing = nullptr; ///< moves jobs between nodes; null if this node does not share its work
    counters counts;
    latency_histogram handler_time; ///< of all handlers that reply later, and of a sample of the others
    std::uint64_t plain_runs = 0;   ///< of those others, for sampling
    unsent_topics unsent;           ///< of `published`
    publications published;
    unsent_topics unsent_relayed; ///< of other nodes, forwarded by this one
    dedup_memory remembered;
    reflection_limit reflection;
    const std::unique_ptr<security_protocol> secured; ///< null: the node is not secured
    const std::shared_ptr<span_recorder> spans;       ///< null: nothing is recorded of traced requests
    const detail::types_part* const types;            ///< null: the types of its tasks are not told
    const std::unique_ptr<job_table> jobs;            ///< null: its jobs are not listed
    std::uint64_t next_id = 1;                        ///< of the requests that this node sends
    router* active_router = nullptr;                  ///< serves requests for `any`, `all` and other nodes; null: none

    /// The other nodes, with the routes to them.
    [[nodiscard]] std::vector<peer> list_peers(time_point now) const;
    // These do not let exceptions of the user's functions out.
    [[nodiscard]] node_load load_now() const noexcept;
    void write_log(log_level level, const log_entry& what) const noexcept;
    /// The same from inside a loop over data that the log function could change.
    void post_log(log_level level, std::string what, std::string peer = {});
    /// Logs a line that others can cause, no more often than it states for its kind and source. The text is made only
    /// then.
    [[gnu::cold]] void log_caused(const caused_line& which, const std::function<std::string()>& text);
    /// Logs that something of this host was dropped, once a minute for each host. `malformed`: no node should send it;
    /// anything else is told at `debug`. The text must not be of the peer.
    [[gnu::cold]] void log_drop(std::string_view host, std::string_view what, std::string_view why, bool malformed);
    /// Logs that a request was denied, at `info`, a few times a minute for each source: the name of the peer, or its
    /// host. The text is made only then.
    [[gnu::cold]] void log_denial(std::string_view source, std::string_view peer,
                                  const std::function<std::string()>& text);

    log_budget logged;
};

} // namespace cles::core
