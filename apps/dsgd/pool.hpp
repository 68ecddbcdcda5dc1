// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "board.hpp"
#include "newcomers.hpp"

#include <boost/asio/io_context.hpp>

namespace dsgd {

/// The nodes, as the manager sees them: a member of their network that offers nothing.
class pool {
  public:
    /// \param seeds    URLs of nodes that know the others
    /// \param deadline of a shard
    /// \param progress is reported on stderr
    pool(const std::vector<std::string>& seeds, std::chrono::seconds deadline, bool progress);

    /// The nodes that offer the task, with the recipe of their data. \throws cles::error that says what is missing
    std::map<std::string, sgd::recipe> find();
    /// Who takes part. \param members offer the task with this data
    /// \param names   only these may come later, or again; none: any node with this data
    void admit(const sgd::recipe& data, const std::vector<std::string>& members, const std::vector<std::string>& names);
    /// Has the nodes train all shards, and those that come meanwhile. Returns when all have ended.
    /// \param what "trial, ", before progress
    void train(board& all, const char* what = "");

  private:
    struct round;
    void begin(round& now);
    void start(round& now, std::size_t attempt);
    boost::asio::awaitable<void> delegate(round& now, std::size_t attempt);
    boost::asio::awaitable<void> watch(round& now);
    boost::asio::awaitable<void> meet(std::string node, std::string epoch);

    std::chrono::seconds deadline_;
    bool progress_;
    boost::asio::io_context io_{1};
    cles::service node_;
    sgd::recipe data_{};
    newcomers newcomers_{};
    round* now_ = nullptr; ///< of `train`
};

} // namespace dsgd
