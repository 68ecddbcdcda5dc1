// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/security/member_rights.hpp>

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace cles {
class json_writer;
}

namespace tool {

/// --may, --offers and --forwards: what a member is permitted.
class rights_options {
  public:
    void add_to(CLI::App& command);

    [[nodiscard]] bool is_any_given() const noexcept { return !may_.empty() || !offers_.empty() || !forwards_.empty(); }
    [[nodiscard]] bool has_may() const noexcept { return !may_.empty(); }
    /// \throws usage_error that says which of them is not valid, and why
    void check() const;
    /// Replaces the lists that were given.
    void apply_to(cles::security::member_rights& rights) const;

  private:
    std::vector<std::string> may_;
    std::vector<std::string> offers_;
    std::vector<std::string> forwards_;
};

/// "everything", "nothing", or the rights, each in quotes.
std::string rights_text(const std::optional<std::vector<std::string>>& listed);

/// Three lines, for people.
std::string rights_lines(const cles::security::member_rights& rights);

/// The keys "may", "offers" and "forwards" of an object. As in a roster, a missing list means everything.
void write_rights(cles::json_writer& w, const cles::security::member_rights& rights);

} // namespace tool
