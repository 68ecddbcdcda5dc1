// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include "security/access/decoded_noun.hpp"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::security {

/// One right, `VERBS NOUN` (docs/security.md, "Rights").
class right {
  public:
    /// Nothing if it is of another form; then `why` says what is wrong.
    static std::optional<right> parse(std::string_view text, std::string* why = nullptr);

    [[nodiscard]] bool permits(verb asked, const decoded_noun& noun) const noexcept;

  private:
    right() = default;

    std::string pattern_;        // target, task and parameters, decoded; see rights.cpp
    std::size_t parameters_ = 0; // how many the pattern has
    bool further_ = false;       // "/**" at the end
    std::uint8_t verbs_ = 0;     // a bit for each
};

/// A list of rights, compiled.
class rights {
  public:
    /// What `find` returns if no right of the list permits it, and if there is no list.
    static constexpr std::int32_t nothing = -1;
    static constexpr std::int32_t everything = -2;

    /// Without a list everything is permitted; rights of another form permit nothing.
    explicit rights(const std::optional<std::vector<std::string>>& listed);

    /// The index in the list of the first right that permits this, or `nothing` or `everything`.
    [[nodiscard]] std::int32_t find(verb asked, const decoded_noun& noun) const noexcept;

  private:
    bool unlimited_ = false;
    std::vector<std::pair<std::int32_t, right>> valid_; // with the index
};

} // namespace cles::security
