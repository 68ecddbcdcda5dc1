// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tool {

/// A noun, or a pattern of nouns as in rights (docs/security.md): `*` stands for any characters within the node, the
/// task or one parameter, and `/**` at the end for any number of further parameters; `NODE:**` is every noun. In a
/// pattern, the node `all` is every node.
class noun_pattern {
  public:
    /// \throws usage_error that says what is wrong with it
    explicit noun_pattern(std::string_view text);

    /// What precedes the colon.
    [[nodiscard]] const std::string& target() const noexcept { return target_; }
    /// Whether it is a noun, without `*`.
    [[nodiscard]] bool is_noun() const noexcept { return is_noun_; }
    /// Whether nodes of several names may match.
    [[nodiscard]] bool is_of_many_nodes() const noexcept;
    [[nodiscard]] bool matches_node(std::string_view name) const;
    /// \param path a task and its parameters, as a node tells it: "tyre/front%20left"
    [[nodiscard]] bool matches_path(std::string_view path) const;

  private:
    /// The texts between the stars of a part, decoded.
    using part = std::vector<std::string>;

    std::string target_;
    part node_;
    std::vector<part> parts_; // of the path
    bool is_noun_ = false;
    bool is_open_ = false; // more parameters may follow
};

} // namespace tool
