// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <set>
#include <string>
#include <utility>

namespace strike {

/// The weapons that are left, and the orders that took the others: none is carried out twice.
class magazine {
  public:
    /// \param before the orders that have taken some of these weapons already
    explicit magazine(std::size_t weapons, std::set<std::string> before = {})
        : left_(weapons - std::min(weapons, before.size())), orders_(std::move(before)) {}

    [[nodiscard]] std::size_t left() const noexcept { return left_; }
    [[nodiscard]] const std::set<std::string>& orders() const noexcept { return orders_; }
    [[nodiscard]] bool has_carried_out(const std::string& order) const { return orders_.contains(order); }
    /// \pre something is left, and the order has not been carried out
    void release(const std::string& order) {
        orders_.insert(order);
        --left_;
    }

  private:
    std::size_t left_;
    std::set<std::string> orders_;
};

} // namespace strike
