// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "protocol/request_line.hpp"

#include <string>

namespace cles::core {

/// A request that outlives the line that it was read from.
class held_request {
  public:
    explicit held_request(const protocol::request_line& r) : line_(r.text) {
        protocol::malformed_request ignored;
        protocol::parse_request(line_, parsed_, ignored); // was read when it came
    }
    held_request(const held_request&) = delete;
    held_request& operator=(const held_request&) = delete;

    [[nodiscard]] const protocol::request_line& operator*() const noexcept { return parsed_; }
    [[nodiscard]] const protocol::request_line* operator->() const noexcept { return &parsed_; }

  private:
    std::string line_;
    protocol::request_line parsed_;
};

} // namespace cles::core
