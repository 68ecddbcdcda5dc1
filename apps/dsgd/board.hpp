// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include "sgd/order.hpp"

#include <optional>
#include <set>

namespace dsgd {

/// What is to be done of a shard, and who is to do it.
struct entry {
    sgd::order what{};
    std::string target{};               ///< who is asked, or was last: a node, or `any`
    std::string fate = "open";          ///< or done, failed, withdrawn
    std::vector<std::string> trouble{}; ///< of each attempt that failed, who and why
};
BOOST_DESCRIBE_STRUCT(entry, (), (what, target, fate, trouble))

/// Who has which shard, and who is to have it when a node fails. It decides; asking and waiting is its caller's.
class board {
  public:
    static constexpr std::size_t most_attempts = 6;

    /// \param targets whose turn it is, shard by shard; none: each shard goes to `any`
    board(const std::vector<sgd::order>& orders, const std::vector<std::string>& targets);

    [[nodiscard]] const std::vector<entry>& shards() const noexcept { return shards_; }
    /// What has been done of each.
    [[nodiscard]] const std::vector<sgd::trained>& parts() const noexcept { return parts_; }
    /// Why all of it failed: the first shard that could not be done.
    [[nodiscard]] const std::optional<cles::error>& failure() const noexcept { return failure_; }

    void done(std::size_t shard, const sgd::trained& part);
    /// True: delegate it again, to whom `target` now says. Training twice does no harm, so that a shard whose node is
    /// lost goes to the one of the others that has the fewest; a node that is busy is asked again. False: it has
    /// failed, or was withdrawn since another has.
    bool failed(std::size_t shard, const cles::error& why);

  private:
    [[nodiscard]] std::string least_loaded() const;

    std::vector<entry> shards_;
    std::vector<sgd::trained> parts_;
    std::set<std::string> nodes_; ///< that have not been lost
    std::optional<cles::error> failure_;
};

} // namespace dsgd
