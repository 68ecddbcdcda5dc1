// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/base/wrapped_operation.hpp"

#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// An operation that also copies the failure that the peer replies to where its requester reads it. Not for BIND, whose
/// replies have marks.
class failure_copy final : public wrapped_operation {
  public:
    failure_copy(detail::pending_ptr operation, std::string& to) : wrapped_operation(std::move(operation)), to_(to) {}

    void refuse(boost::system::error_code code, std::string_view message, std::string_view answer) override {
        const std::unique_ptr<failure_copy> self{this};
        to_ = answer;
        take_operation().release()->refuse(code, message, answer);
    }

  private:
    std::string& to_;
};

} // namespace cles::core
