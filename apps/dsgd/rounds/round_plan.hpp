// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include "digits/network.hpp"

#include <boost/describe/class.hpp>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace dsgd {

/// What came of a round.
struct round_result {
    std::uint64_t round = 0;          ///< from 1 on
    std::vector<std::string> nodes{}; ///< whose networks were averaged
    std::vector<std::string> late{};  ///< that did not answer in time
    std::uint64_t images = 0;         ///< that were trained on, each as often as it was
    double loss = 0;                  ///< the mean of the nodes, by their images
    double began_ms = 0, ended_ms = 0;
};
BOOST_DESCRIBE_STRUCT(round_result, (), (round, nodes, late, images, loss, began_ms, ended_ms))

/// Local descent with averaging (McMahan and others, "Communication-efficient learning of deep networks from
/// decentralized data", 2017). In each round all nodes train the same network, each on images of its own, and the next
/// round begins with the mean of their results, in which each counts by its images. It only decides; its caller sends
/// and waits. Times are those since the beginning, in ms.
class round_plan {
  public:
    /// A node is late after so many times the median of those that have answered, if these are at least half of all,
    /// ...
    static constexpr double late_factor = 3;
    /// ... and so much more: to leave a node out costs accuracy, and one that hangs is waited for once only.
    static constexpr double late_more_ms = 1'000;
    static constexpr std::uint64_t most_attempts = 50; ///< in a row, if a node is busy

    round_plan(digits::network start, std::uint64_t rounds) : now_(std::move(start)), rounds_(rounds) {}

    /// A node that offers the task; it gets work from the next round on.
    void join(const std::string& node);

    /// The nodes that get the present network now. If none does, the round is over, or goes on.
    std::vector<std::string> to_ask(double now_ms);
    /// \param round  for which it was asked. Of an earlier round, the result is not used: it began with an older
    /// network \param images that it was trained on, each as often as it was
    void answered(const std::string& node, std::uint64_t round, digits::network result, std::uint64_t images,
                  double loss, double now_ms);
    /// A lost node gets no more work until it joins again; a busy one is asked again, and is lost after
    /// `most_attempts`.
    void failed(const std::string& node, std::uint64_t round, const cles::error& why);
    /// Ends the round, if all have answered or the others are late, and averages. None if it goes on.
    std::optional<round_result> end_round(double now_ms);

    [[nodiscard]] std::uint64_t round() const noexcept { return round_; } ///< from 1 on
    [[nodiscard]] bool finished() const noexcept { return round_ > rounds_ || failure_; }
    [[nodiscard]] const digits::network& present() const noexcept { return now_; }
    /// Why it cannot go on.
    [[nodiscard]] const std::optional<cles::error>& failure() const noexcept { return failure_; }
    /// The nodes that are not lost.
    [[nodiscard]] std::vector<std::string> members() const;

  private:
    enum class state { idle, asked, answered, late };
    struct member {
        state is = state::idle;
        std::uint64_t attempts = 0; ///< in a row, because it is busy
    };
    struct part {
        std::string node{};
        digits::network result{};
        std::uint64_t images = 0;
        double loss = 0, took_ms = 0;
    };

    [[nodiscard]] bool is_over(double now_ms) const;

    digits::network now_;
    std::uint64_t rounds_;
    std::uint64_t round_ = 1;
    bool begun_ = false; ///< the round
    double began_ms_ = 0;
    std::map<std::string, member> members_{};
    std::vector<part> parts_{};
    std::optional<cles::error> failure_{};
};

} // namespace dsgd
