// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/service.hpp>

#include "digits/descent.hpp"
#include "digits/model.hpp"
#include "dsgd/rounds/round_plan.hpp"
#include "neighbourhood.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>

#include <exception>
#include <functional>

namespace dsgd {

/// What a node publishes as `model`: its network after it has trained for a round; that of round 0 is the start.
struct told_network {
    std::uint64_t round = 0;
    std::uint64_t degree = 0; ///< how many neighbours the node has
    digits::model network{};
};
BOOST_DESCRIBE_STRUCT(told_network, (), (round, degree, network))

/// A node that trains a network on its own images, and averages with its neighbours: it publishes `model`, and binds
/// theirs.
class participant {
  public:
    struct options {
        std::string name{}, listen{};
        std::vector<std::string> seeds{}, neighbours{};
        bool insecure = false;
        std::uint64_t rounds = 0;
        double patience_ms = 0; ///< how long a neighbour is waited for that was never there
        digits::schedule how{}; ///< of a round; the seed is that of the first
    };

    /// \param images outlive it
    participant(const options& wanted, const digits::image_set& images, digits::network start);

    [[nodiscard]] std::string endpoint() const { return node_.endpoints().front(); }
    /// Trains all rounds. \param told of each round, with the mean with which the next one begins
    /// \return the bytes of all networks, as text: of those that are published, once for each neighbour, also while it
    /// is not there, and of those that are received
    std::uint64_t run(const std::function<void(const round_result&, const digits::network&)>& told);

  private:
    boost::asio::awaitable<void> train(const std::function<void(const round_result&, const digits::network&)>& told);
    boost::asio::awaitable<void> follow(std::string neighbour);
    void publish(std::uint64_t round, const digits::network& n);
    double ms() const;

    options wanted_;
    const digits::image_set& images_;
    digits::shape form_;
    digits::network now_;
    neighbourhood all_;
    boost::asio::io_context io_{1};
    cles::service node_;
    boost::asio::steady_timer heard_{io_}; ///< cancelled when a neighbour was heard, or lost
    std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
    std::uint64_t bytes_ = 0;
    bool ended_ = false;
    std::exception_ptr crash_{};
};

} // namespace dsgd
