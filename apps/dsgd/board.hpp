// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include "sgd/order.hpp"

#include <optional>
#include <set>

namespace dsgd {

/// The order for a shard, and the node for it.
struct entry {
    sgd::order what{};
    std::string target{};               ///< the node that is or was asked last, or `any`
    std::string fate = "open";          ///< or done, failed, withdrawn
    std::vector<std::string> trouble{}; ///< node and reason of each failed attempt
};
BOOST_DESCRIBE_STRUCT(entry, (), (what, target, fate, trouble))

/// Assigns shards to nodes, again when a node fails. It only decides; its caller sends and waits.
class board {
  public:
    static constexpr std::size_t max_attempts = 6;

    /// \param targets the nodes, in turn; none: each shard goes to `any`
    board(const std::vector<sgd::order>& orders, const std::vector<std::string>& targets);

    [[nodiscard]] const std::vector<entry>& shards() const noexcept { return shards_; }
    /// The results.
    [[nodiscard]] const std::vector<sgd::trained>& parts() const noexcept { return parts_; }
    /// The reason of the first shard that could not be done.
    [[nodiscard]] const std::optional<cles::error>& failure() const noexcept { return failure_; }

    void done(std::size_t shard, const sgd::trained& part);
    /// \return whether to delegate it again, to the present `target`. Training twice does no harm: a shard whose node
    /// is lost goes to the node with the fewest shards; a busy node is asked again. Otherwise it has failed, or was
    /// withdrawn because another one has.
    bool failed(std::size_t shard, const cles::error& why);

  private:
    [[nodiscard]] std::string least_loaded() const;

    std::vector<entry> shards_;
    std::vector<sgd::trained> parts_;
    std::set<std::string> nodes_; ///< that are not lost
    std::optional<cles::error> failure_;
};

} // namespace dsgd
