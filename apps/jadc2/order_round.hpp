// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <set>
#include <string>
#include <utility>
#include <vector>

namespace jadc2 {

/// To whom one order is offered: once to each node that offers `strike`, until one does not refuse it, or the order
/// ends. Times are s since 1970.
class order_round {
  public:
    explicit order_round(double until) : until_(until) {}

    enum class step {
        offer, ///< to `node`
        wait,  ///< no node that offers it is known yet
        end,   ///< it is refused
    };
    struct move {
        step what = step::end;
        std::string node{};
    };

    /// \param candidates in the order in which they are to be asked
    [[nodiscard]] move next(const std::vector<std::string>& candidates, double now);
    /// The node that was asked last has refused it.
    void refused(std::string why) { trouble_ = std::move(why); }
    /// Why the last one has refused it; empty if nobody was asked.
    [[nodiscard]] const std::string& trouble() const noexcept { return trouble_; }
    [[nodiscard]] double until() const noexcept { return until_; }

  private:
    double until_;
    std::set<std::string> asked_;
    std::string trouble_;
};

} // namespace jadc2
