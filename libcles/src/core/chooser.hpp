// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/catalogue.hpp"
#include "core/choice.hpp"
#include "core/node.hpp"
#include "protocol/request_line.hpp"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Finds who serves a request for `any`: this node counts too.
class chooser {
  public:
    chooser(const node& host, const catalogue& others, std::uint32_t seed) noexcept
        : node_(host), others_(others), choice_(seed) {}

    struct chosen {
        known_node* other = nullptr; ///< null: this node, or nobody
        bool here = false;
        bool idempotent = false;

        [[nodiscard]] bool nobody() const noexcept { return other == nullptr && !here; }
    };
    /// One that offers it, is live, has not been passed, and is not among those that were asked already. Who is busy or
    /// out of reach is asked only where there is nobody else, and who has all workers at long jobs only where nobody
    /// has a free one.
    [[nodiscard]] chosen choose(const protocol::request_line& r, const std::vector<std::string>& asked, time_point now);
    /// This node refused work.
    void avoid_here(time_point until) noexcept { here_.avoid_until = until; }

  private:
    void gather(const protocol::request_line& r, const std::vector<std::string>& asked, bool may_be_here);

    const node& node_;
    const catalogue& others_;
    choice choice_;
    candidate here_;
    std::vector<candidate*> all_;     // of this choice
    std::vector<candidate*> at_once_; // of these, those that are not to be avoided
};

/// Whether this node has a handler for it.
bool offers(const node& n, verb v, std::string_view task);

} // namespace cles::core
