// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/access/rights.hpp"
#include "security/fleet/protected_folder.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::security {

/// The file `rules` of a node's directory, which narrows what the roster permits (docs/security.md, "Local rules"): one
/// rule per line. Empty lines are ignored, as is what follows `#`; words are separated by spaces or tabs.
class local_rules {
  public:
    static constexpr std::size_t max_size = 65'536;
    static constexpr std::size_t max_rules = 1000;

    /// Whether a rule is about what nodes of its name request, or what is requested of them.
    enum class subject : std::uint8_t { may, offers };

    struct rule {
        std::size_t line = 0; ///< from 1
        std::string text{};   ///< without comment, and with single spaces
        bool allows = false;
        subject about = subject::may;
        std::string name{}; ///< a pattern
        right what;
    };

    /// No rules: everything is left to the roster.
    local_rules() = default;
    /// Reads the file. If there is an error in it, the result denies everything.
    static local_rules parse(std::string_view file);
    /// What the node uses if it cannot read the file: denies everything.
    static local_rules unreadable(std::string why);

    /// Whether there is an error, so that everything is denied.
    [[nodiscard]] bool denies_everything() const noexcept { return !error_.empty(); }
    /// "line 3: 'deny sat* may drive *:x': 'drive' is not a verb..."; empty if there is none.
    [[nodiscard]] const std::string& error() const noexcept { return error_; }

    [[nodiscard]] const std::vector<rule>& rules() const noexcept { return rules_; }
    /// The first rule that matches; null if there is none.
    /// \param requester empty for a request of this node, to which `may` does not apply
    [[nodiscard]] const rule* find(std::string_view requester, verb asked, const decoded_noun& noun) const noexcept;

  private:
    std::vector<rule> rules_;
    std::string error_;
};

/// Reads `rules` in a node's directory. Without this file there are no rules; if it cannot be read, belongs to another
/// user, or has an error, the result denies everything.
[[nodiscard]] local_rules read_local_rules(const protected_folder& folder);

} // namespace cles::security
