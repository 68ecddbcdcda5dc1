// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include "sgd/order.hpp"
#include "splitter.hpp"

#include <optional>
#include <set>

namespace dsgd {

/// The order for a shard, and the node for it.
struct entry {
    sgd::order what{};
    std::string target{};               ///< the node that is or was asked last, or `any`
    std::size_t slot = 0;               ///< whose shards are trained one after the other
    std::string fate = "open";          ///< or done, lost (its points are in other shards), failed, withdrawn
    std::vector<std::string> trouble{}; ///< node and reason of each failed attempt
};
BOOST_DESCRIBE_STRUCT(entry, (), (what, target, slot, fate, trouble))

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

/// Assigns shards to nodes, again when a node fails. It only decides; its caller sends and waits.
class board {
  public:
    static constexpr std::size_t max_attempts = 6;

    /// A slot for each order.
    /// \param targets the nodes, in turn; none: each shard goes to `any`
    board(const std::vector<sgd::order>& orders, const std::vector<std::string>& targets);
    /// Shards that are made while others are trained. A slot's next one goes on from the result of its last one.
    /// \param points are divided among the slots
    /// \param like   what all orders have in common; its seed is that of the first
    board(std::uint64_t points, std::size_t slots, const sgd::order& like, const std::vector<std::string>& targets);

    [[nodiscard]] std::size_t slots() const noexcept { return slots_; }
    /// Of all shards together, even those that are not made yet.
    [[nodiscard]] std::uint64_t points() const noexcept { return points_; }
    /// The shard that the slot trains next; none if it has nothing to do, until another one's shard is lost.
    /// \param now_ms since the beginning of all
    std::optional<std::size_t> next(std::size_t slot, double now_ms);
    /// No slot has anything to do any more.
    [[nodiscard]] bool finished() const;

    [[nodiscard]] const std::vector<entry>& shards() const noexcept { return shards_; }
    /// The results; without points where there is none.
    [[nodiscard]] const std::vector<sgd::trained>& parts() const noexcept { return parts_; }
    /// The reason of the first shard that could not be done.
    [[nodiscard]] const std::optional<cles::error>& failure() const noexcept { return failure_; }
    /// \param trial_ms was spent before
    [[nodiscard]] times spent(double trial_ms = 0) const;

    /// \param part with `after_ms`
    void done(std::size_t shard, const sgd::trained& part);
    /// If the node is lost, the shard is trained elsewhere, which does no harm: with a splitter its points are divided
    /// again, otherwise it goes to the node with the fewest shards. A busy node is asked again. Otherwise the shard has
    /// failed, or was withdrawn because another one has.
    /// \return false in the last case; otherwise it is to be delegated again, to the present `target`, if it is open
    bool failed(std::size_t shard, const cles::error& why);

  private:
    [[nodiscard]] std::string target_of(std::size_t slot) const;
    [[nodiscard]] std::string least_loaded() const;
    [[nodiscard]] std::optional<sgd::classifier> last_result(std::size_t slot) const;

    std::size_t slots_;
    std::uint64_t points_ = 0;
    std::vector<std::string> targets_;
    sgd::order like_{};
    std::optional<splitter> splitter_{};
    std::set<std::size_t> begun_{}; ///< slots, without a splitter
    std::vector<entry> shards_{};
    std::vector<sgd::trained> parts_{};
    std::set<std::string> nodes_; ///< that are not lost
    std::optional<cles::error> failure_{};
};

} // namespace dsgd
