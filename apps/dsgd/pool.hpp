// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "board.hpp"

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
    /// Delegates the shards of all slots at once, those of a slot one after the other. Returns when all have ended.
    /// \param what "trial, ", before progress
    void train(board& all, const char* what = "");

  private:
    struct round;
    boost::asio::awaitable<void> work(round& now, std::size_t slot);
    boost::asio::awaitable<void> delegate(round& now, std::size_t i);

    std::chrono::seconds deadline_;
    bool progress_;
    boost::asio::io_context io_{1};
    cles::service node_;
};

} // namespace dsgd
