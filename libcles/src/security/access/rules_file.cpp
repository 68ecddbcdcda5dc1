// SPDX-License-Identifier: BSL-1.0
#include "security/access/rules_file.hpp"

#include "security/keys/keys.hpp"

namespace cles::security {

local_rules read_local_rules(const protected_folder& folder) try {
    const auto content = folder.read_text("rules", local_rules::max_size);
    return content ? local_rules::parse(*content) : local_rules{};
} catch (const security_error& e) {
    return local_rules::unreadable(e.what());
}

} // namespace cles::security
