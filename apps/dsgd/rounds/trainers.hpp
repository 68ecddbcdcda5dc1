// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "digits/order.hpp"
#include "dsgd/newcomers.hpp"
#include "round_plan.hpp"

#include <boost/asio/io_context.hpp>

#include <functional>

namespace dsgd {

/// The nodes that train networks on their images, as the manager of rounds sees them.
class trainers {
  public:
    /// \param seeds    URLs of nodes that know the others
    /// \param names    only these nodes take part; none: all that offer the task
    /// \param deadline of a node in a round
    trainers(const std::vector<std::string>& seeds, const std::vector<std::string>& names,
             std::chrono::seconds deadline);

    /// The nodes that take part, and what they have. They and those that come later need images of this kind.
    /// \throws cles::error that says what is missing
    std::map<std::string, digits::offer> find(std::uint32_t pixels, std::uint32_t classes);
    /// Has the nodes train until all rounds have ended.
    /// \param how  without `start`; its seed is that of the first round
    /// \param told of each round, while the nodes train for the next one
    /// \return the bytes of all networks that were sent and received, as text
    std::uint64_t run(round_plan& plan, const digits::order& how, const std::function<void(const round_result&)>& told);

  private:
    struct course;
    void ask(course& now);
    void advance(course& now);
    boost::asio::awaitable<void> train(course& now, std::string node);
    boost::asio::awaitable<void> watch(course& now);
    boost::asio::awaitable<void> meet(course& now, std::string node, std::string epoch);

    std::chrono::seconds deadline_;
    boost::asio::io_context io_{1};
    cles::service node_;
    std::vector<std::string> names_;
    newcomers newcomers_;
    std::uint32_t pixels_ = 0, classes_ = 0;
};

} // namespace dsgd
