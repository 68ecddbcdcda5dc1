// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/standard.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles {

/// One member of what a schema describes, for people.
struct schema_member {
    std::string path; ///< as in "route[].lat"
    std::string type; ///< as in "number", "one of red, green", "array of text"
    std::string unit; ///< may be empty, as what follows
    std::string meaning;
    std::string range;    ///< as in "-90 to 90"
    std::string standard; ///< the JSON of the value that a missing member has
    bool required = false;
};

/// A JSON Schema of the subset that CLES writes and understands (docs/protocol.md, "Types"). It decides as the reader
/// of the type does from which it was derived. Copies share their content.
class schema {
  public:
    /// \throws cles::error with `conversion` if the text is no schema of the subset
    explicit schema(std::string_view text);

    /// Why the JSON text does not fit, as in "route[2].lat: expected a number, got a string"; empty if it fits.
    [[nodiscard]] std::string mismatch(std::string_view json) const;
    /// A value that fits, with all members that have to be there; empty if none was found.
    [[nodiscard]] std::string example() const;
    /// The members, down to a few levels.
    [[nodiscard]] std::vector<schema_member> members() const;
    /// What it describes in a few words, as in "array of number".
    [[nodiscard]] std::string summary() const;

  private:
    struct content;
    std::shared_ptr<const content> content_;
};

/// What a verb of a task tells about its types: the texts of schemas, empty where nothing is known.
struct task_schemas {
    std::string parameters{}; ///< of the array of the parameters, which are texts
    std::string body{};
    std::string result{};
    std::string updates{}; ///< of the nouns that are published
};

/// Writes them as `task_info::types`. \throws cles::error with `invalid_option`, which names the part, if one of them
/// is no schema of the subset, or they are longer than 64 KiB
[[nodiscard]] std::string task_types(const task_schemas& told);
/// The reverse. \throws cles::error with `conversion` if the text is not of this form
[[nodiscard]] task_schemas read_task_types(std::string_view text);

} // namespace cles
