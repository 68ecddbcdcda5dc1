// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "digits/network.hpp"

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace dsgd {

/// What a node knows of its neighbours, and how it averages with them, without a manager (Lian and others, "Can
/// decentralized algorithms outperform centralized algorithms?", 2017). In each round, a node trains its network on its
/// own images, tells it to its neighbours, and goes on with a mean of theirs and its own. If neighbours are mutual, the
/// mean of all networks stays what it is, and so all come to agree. It only decides; its caller trains, publishes and
/// waits. Times are those since the beginning, in ms.
class neighbourhood {
  public:
    /// A neighbour is late after so many times the median of the rounds before, ...
    static constexpr double late_factor = 3;
    /// ... and so much more: to leave it out costs accuracy, and one that hangs is waited for once only.
    static constexpr double late_more_ms = 1'000;

    /// \param neighbours at least one
    /// \param patience_ms how long one is waited for that was never heard
    neighbourhood(std::vector<std::string> neighbours, double patience_ms)
        : neighbours_(std::move(neighbours)), patience_ms_(patience_ms) {}

    /// How many neighbours there are: it is told to them.
    [[nodiscard]] std::uint64_t degree() const noexcept { return neighbours_.size(); }
    /// This node has trained for a round, from 1 on, and waits from now on.
    void trained(std::uint64_t round, digits::network own, double now_ms);
    /// A neighbour has trained for a round. \param degree that it has
    void hear(const std::string& neighbour, std::uint64_t round, std::uint64_t degree, digits::network network);
    /// It is not waited for until it is heard again.
    void lose(const std::string& neighbour) { absent_.insert(neighbour); }

    /// The last round for which it has trained, as far as this node has heard.
    [[nodiscard]] std::uint64_t last_round(const std::string& neighbour) const;

    /// Whether nobody is waited for any more. Those that are late from now on are lost.
    bool ready(double now_ms);
    /// The neighbours that are not waited for.
    [[nodiscard]] const std::set<std::string>& absent() const noexcept { return absent_; }
    /// The mean with which this node goes on, when it is ready: a neighbour counts as 1 / (1 + the larger of both
    /// degrees), and this node as the rest (Metropolis weights). Of a neighbour that has not told this round, but a
    /// later one, that counts; one that has told neither is left out.
    digits::network mix(double now_ms);
    /// The round with which this node goes on: the next one, or if it was left behind, that for which its neighbours
    /// train.
    [[nodiscard]] std::uint64_t next_round() const;
    /// The neighbours that were in the last mean.
    [[nodiscard]] const std::vector<std::string>& mixed() const noexcept { return mixed_; }

  private:
    struct told {
        std::uint64_t degree = 0;
        digits::network network{};
    };
    using rounds = std::map<std::uint64_t, told>;

    [[nodiscard]] double limit_ms() const;

    std::vector<std::string> neighbours_;
    double patience_ms_;
    digits::network own_{};
    std::uint64_t round_ = 0;
    double waits_since_ms_ = 0, last_ms_ = 0;
    std::vector<double> took_ms_{};         ///< the last rounds
    std::map<std::string, rounds> heard_{}; ///< the rounds of each neighbour that may still be needed
    std::map<std::string, std::uint64_t> last_{};
    std::set<std::string> absent_{};
    std::vector<std::string> mixed_{};
};

} // namespace dsgd
