// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/security/access.hpp>

#include "security/access/access_policy.hpp"

#include <string_view>

namespace cles::security {

/// Something that was decided by a policy.
struct decided_access {
    std::string_view requester{};
    std::string_view forwarder{}; ///< empty for none
    std::string_view target{};
    access_decision made{};
};

/// What decides it, for people.
[[nodiscard]] access_answer explain(const access_policy& policy, const decided_access& decided);

} // namespace cles::security
