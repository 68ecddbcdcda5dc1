// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>
#include <cles/peer.hpp>
#include <cles/verb.hpp>

#include "node/base/deadlines.hpp"
#include "node/base/string_map.hpp"
#include "node/node_state.hpp"
#include "node/routing/next_hop.hpp"
#include "node/routing/query_scheduler.hpp"
#include "node/routing/subrequest.hpp"

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::core {

inline constexpr std::size_t max_tasks_of_a_node = 4096;

/// The tasks of a node, as it reports them.
struct task_list {
    struct entry {
        cles::verb verb = verb::pull;
        std::string task;
        bool idempotent = false;
        bool local = false; ///< its jobs do not move to other nodes
        bool must_be_signed = false;
    };
    std::vector<entry> entries;
};

/// Reads the reply to `PULL self:cles`. Nothing if it is malformed, or of another node.
std::optional<task_list> read_task_list(std::string_view description, std::string_view node);

/// A node that can be given work.
struct candidate {
    node_load load;                    ///< as last reported
    std::uint32_t given = 0;           ///< this node's requests in progress there
    std::uint32_t given_at_report = 0; ///< of these, in progress when the load was reported
    time_point avoid_until{};          ///< it was busy or unreachable, and is not asked before

    /// The estimated work it has now.
    [[nodiscard]] std::uint64_t estimated_work() const noexcept {
        const auto known = std::uint64_t{load.queued} + load.running + given;
        return known > given_at_report ? known - given_at_report : 0;
    }
    /// Whether more work would probably start at once.
    [[nodiscard]] bool is_free() const noexcept {
        return load.workers == 0 ? !is_saturated() : estimated_work() < load.workers;
    }
    /// Whether all its workers are occupied and not likely to finish soon. If all are stuck, it reports no workers.
    [[nodiscard]] bool is_saturated() const noexcept {
        constexpr std::uint32_t long_us = 100'000;
        return load.running != 0 && load.running >= load.workers && load.service_us >= long_us;
    }
    /// Applies a reported load.
    void update_load(const node_load& now) noexcept {
        load = now;
        given_at_report = given;
    }
};

/// Another node and its tasks.
struct known_node : candidate, query_target {
    std::string name;
    bool live = true; ///< received recently
    std::uint32_t epoch = 0;
    std::string digest; ///< of its tasks, as announced

    enum class task_knowledge : std::uint8_t { unknown, asked, known };
    task_knowledge state = task_knowledge::unknown;
    std::uint64_t ticket = 0;                 ///< of its last query
    std::optional<time_point> expected_until; ///< its tasks may become known at any moment until then
    std::shared_ptr<const task_list> tasks;

    /// Whether it is at an address usable from here.
    [[nodiscard]] bool reachable() const noexcept { return !where.empty(); }
};

/// Which other nodes offer which tasks: follows `membership`, and queries the tasks of a node when its announced digest
/// changes. Nodes with the same digest offer the same tasks, and they are queried one at a time until one replies. The
/// cost of an announcement or of a failed query does not depend on the number of known nodes, except that those of its
/// digest at a failing URL are queued once for each pause of that URL.
class service_registry final : private deadline {
  public:
    struct offer {
        known_node* by = nullptr;
        bool idempotent = false;
    };

    static constexpr std::chrono::milliseconds answer_within{1'000};

    /// `on_offers` is called when offers have been added or removed, or no more are expected.
    service_registry(node_state& host, next_hop& out, std::function<void()> on_offers);
    ~service_registry();
    /// Sends no more queries.
    void stop() noexcept;

    /// For the task `cles`: all nodes. Valid until the next change.
    [[nodiscard]] const std::vector<offer>& offers(verb v, std::string_view task) const;
    /// Whether the tasks of further nodes may become known at any moment. A node is waited for from when it is first
    /// received, and from its turn after other nodes of its digest; each time for a second, and not during a pause of
    /// its URL.
    [[nodiscard]] bool expects_more() const noexcept { return !expected_.empty(); }
    /// Null if it is not known.
    [[nodiscard]] known_node* find(std::string_view name) noexcept;
    [[nodiscard]] const known_node* find(std::string_view name) const noexcept;
    /// By name.
    [[nodiscard]] const std::map<std::string, std::unique_ptr<known_node>, std::less<>>& nodes() const noexcept {
        return nodes_;
    }

  private:
    /// The nodes with one digest.
    struct digest_group {
        std::map<std::string_view, known_node*> nodes{}; // by name
        std::shared_ptr<const task_list> tasks{};        // null: not known
        const known_node* asked = nullptr;               // the others wait for its reply
        /// By the number of failures and the name: a node that failed does not overtake one that was never asked.
        std::map<std::pair<unsigned, std::string_view>, known_node*> waiting{};
    };

    void on_member_seen(std::string_view name);
    void on_deadline(time_point now) override;
    void restart_discovery(known_node& of, std::string_view digest, std::string_view where, time_point now);
    void leave_digest_group(known_node& n);
    void forget(known_node& n, time_point now);
    void expect(known_node& n, std::optional<time_point> until);
    void wait_for_turn(known_node& n);
    void give_up(known_node& n);
    void ask(time_point now);
    void on_reply(const std::string& name, std::uint64_t ticket, std::string_view said, const subrequest_failure* why);
    void on_tasks(known_node& of, task_list list);
    void on_no_reply(known_node& of, bool unreachable, time_point now);
    void on_postponed(known_node& n);
    void wake_next(digest_group& of);
    void expect_next(const digest_group& of);
    void follow();
    void set_tasks(known_node& of, std::shared_ptr<const task_list> tasks);
    void forget_offers(const known_node& of);
    void offer_all(const known_node& of);
    [[nodiscard]] digest_group* digest_group_of(const known_node& n) noexcept;

    node_state& node_;
    next_hop& out_;
    std::function<void()> on_offers_;
    std::map<std::string, std::unique_ptr<known_node>, std::less<>> nodes_;
    using by_verb = std::array<std::vector<offer>, verb_count>;
    string_map<by_verb> offers_;
    std::vector<offer> all_nodes_;
    std::map<std::string, digest_group, std::less<>> digest_groups_; // by digest
    query_scheduler queries_;
    std::set<std::pair<time_point, std::string_view>> expected_; // until when, and the name
    bool expected_more_ = false;                                 // when `follow` was last called
    bool offers_changed_ = false;                                // since `on_offers_` was last called
    std::uint64_t last_ticket_ = 0;
    std::shared_ptr<service_registry*> alive_; // for replies that arrive after its destruction
};

} // namespace cles::core
