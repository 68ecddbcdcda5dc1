// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include "sgd/order.hpp"
#include "splitter.hpp"

#include <map>
#include <optional>
#include <set>

namespace dsgd {

/// The order for a shard, and the nodes for it.
struct entry {
    sgd::order what{};
    std::string target{};               ///< the node that is or was asked last, or `any`
    std::size_t slot = 0;               ///< whose shards are trained one after the other
    std::string fate = "open";          ///< or done, lost (its points are in other shards), failed, withdrawn
    std::vector<std::string> also{};    ///< the nodes that were asked as well, because it was late
    std::vector<std::string> trouble{}; ///< node and reason of each failed attempt
};
BOOST_DESCRIBE_STRUCT(entry, (), (what, target, slot, fate, also, trouble))

/// A request for a shard. A late shard has several, of which the first answer counts.
struct attempt {
    std::size_t shard = 0;
    std::string target{}; ///< a node, or `any`
    double begun_ms = 0;
    bool ended = false;
};

/// Where the time went.
struct times {
    double elapsed_ms = 0;  ///< until the last part was there, with the trial before
    double longest_ms = 0;  ///< that the parts of a slot took by their nodes' own clocks
    double overhead_ms = 0; ///< the difference: what it costs that others do it
};
BOOST_DESCRIBE_STRUCT(times, (), (elapsed_ms, longest_ms, overhead_ms))

/// How many points a shard has at least if it is made while others are trained: 500, whose best classifier is almost
/// that of all points, and so many that it takes 5 / rate steps. After these, a descent has forgotten where it began,
/// if the points have the variance 1.
std::uint64_t least_points(const sgd::order& like);

/// Assigns shards to nodes: as many at a time as a node has workers, again if a node fails, and to another node as well
/// if they are late. Nodes may join. It only decides; its caller sends and waits. Times are those since the beginning
/// of all, in ms.
class board {
  public:
    static constexpr std::size_t max_attempts = 6;
    /// A shard is late after so many times the time that was to be expected, ...
    static constexpr double late_factor = 3;
    /// ... and so much more, because short times vary by chance.
    static constexpr double late_more_ms = 100;
    /// So many nodes are asked as well, one after the other.
    static constexpr std::size_t most_copies = 3;

    /// A slot for each order.
    /// \param targets the nodes, in turn; none: each shard goes to `any`
    board(const std::vector<sgd::order>& orders, const std::vector<std::string>& targets);
    /// Shards that are made while others are trained. A slot's next one goes on from the result of its last one.
    /// \param points are divided among the slots
    /// \param like   what all orders have in common; its seed is that of the first
    board(std::uint64_t points, std::size_t slots, const sgd::order& like, const std::vector<std::string>& targets);

    /// A node that may get shards: one of the targets, another one that offers the task, or one that is there again.
    /// Of the first kind of board, it gets shards for `any`, and late or lost ones. Of the second kind, a new node gets
    /// as many slots as each of the others has.
    /// \param workers how many shards it trains at a time; 0: not known, so all at once
    void join(const std::string& node, std::size_t workers);
    /// Another factor for `late_factor`.
    void late_after(double factor) noexcept { late_factor_ = factor; }

    [[nodiscard]] std::size_t slots() const noexcept { return slots_; }
    /// Of all shards together, even those that are not made yet.
    [[nodiscard]] std::uint64_t points() const noexcept { return points_; }
    /// The attempt that is to be begun now; none until another one ends, a shard is late, or a node joins. If all nodes
    /// are lost, but a late shard is still with one of them, that one is waited for.
    std::optional<std::size_t> next(double now_ms);
    /// An attempt for a shard that is late, at a node with a free worker; none if there is no such shard or node.
    /// Shards that nobody has begun come first.
    std::optional<std::size_t> late(double now_ms);
    /// Nothing is left to do.
    [[nodiscard]] bool finished() const;

    [[nodiscard]] const std::vector<entry>& shards() const noexcept { return shards_; }
    [[nodiscard]] const std::vector<attempt>& attempts() const noexcept { return attempts_; }
    /// The results; without points where there is none.
    [[nodiscard]] const std::vector<sgd::trained>& parts() const noexcept { return parts_; }
    /// The nodes that may get shards: neither lost nor overtaken.
    [[nodiscard]] const std::set<std::string>& nodes() const noexcept { return nodes_; }
    /// The reason of the first shard that could not be done.
    [[nodiscard]] const std::optional<cles::error>& failure() const noexcept { return failure_; }
    /// \param trial_ms was spent before
    [[nodiscard]] times spent(double trial_ms = 0) const;

    /// \param part with `after_ms`, which is now
    /// \return the other attempts for the shard, which are to be withdrawn
    std::vector<std::size_t> done(std::size_t attempt, const sgd::trained& part);
    /// If the node is lost, the shard is trained elsewhere, which does no harm: with a splitter its points are divided
    /// again, otherwise it goes to the node with the fewest shards. A busy node is asked again. If another node has the
    /// shard as well, that one goes on with it. Otherwise the shard has failed, or was withdrawn because another one
    /// has.
    /// \return whether the attempt is to be repeated, at its present `target`
    bool failed(std::size_t attempt, const cles::error& why, double now_ms);

  private:
    std::size_t begin(std::size_t shard, const std::string& target, double now_ms);
    void end(attempt& which);
    void move(attempt& which, const std::string& target);
    void fail(std::size_t shard, const cles::error& why);
    /// Gives the shards of a node that nobody has begun to others, and no more to it, if there are others.
    void avoid(const std::string& node);
    void give_away(const std::string& node);
    [[nodiscard]] std::optional<std::size_t> next_of_slots(double now_ms);
    [[nodiscard]] std::string target_of(std::size_t slot) const;
    [[nodiscard]] std::string least_loaded() const;
    [[nodiscard]] std::optional<std::string> helper_for(std::size_t shard) const;
    [[nodiscard]] std::optional<sgd::classifier> last_result(std::size_t slot) const;
    [[nodiscard]] bool may_take(const std::string& target) const;
    [[nodiscard]] std::size_t running_at(const std::string& target) const;
    [[nodiscard]] std::size_t attempts_for(std::size_t shard) const;
    /// How long it is expected to take. \param usual_ms the median of `took_ms_`
    [[nodiscard]] double expected_ms(const entry& shard, double usual_ms) const;

    std::size_t slots_;
    std::uint64_t points_ = 0;
    std::vector<std::string> slot_targets_; ///< a node, or `any`
    std::size_t slots_per_node_ = 1;
    sgd::order like_{};
    std::optional<splitter> splitter_{};
    std::vector<entry> shards_{};
    std::vector<sgd::trained> parts_{};
    std::vector<attempt> attempts_{};
    std::set<std::size_t> begun_{}; ///< shards
    std::set<std::size_t> busy_{};  ///< slots
    std::set<std::string> nodes_;
    std::map<std::string, std::size_t> workers_{}; ///< where they are known
    std::map<std::string, std::size_t> running_{}; ///< attempts, by target
    std::map<std::string, double> heard_ms_{};     ///< when a node has last answered
    std::vector<double> took_ms_{};                ///< of each answer; with a splitter, for each of its points
    std::optional<cles::error> failure_{};
    double late_factor_ = late_factor;
};

} // namespace dsgd
