// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include "protocol/grammar.hpp"

#include <boost/container/static_vector.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::security {

/// A noun as rights see it: decoded, and with the name of the node that serves as target. It borrows what it was
/// assigned, and can be assigned again; then it allocates only for parameters with escapes that are longer than before.
class decoded_noun {
  public:
    decoded_noun() = default;
    /// \param target the name of the node that serves, instead of `noun.target`
    decoded_noun(std::string_view target, const protocol::noun_view& noun) { assign(target, noun); }
    decoded_noun(const decoded_noun&) = delete; // contains views of itself
    decoded_noun& operator=(const decoded_noun&) = delete;
    ~decoded_noun() = default;

    void assign(std::string_view target, const protocol::noun_view& noun);

    [[nodiscard]] std::string_view target() const noexcept { return target_; }
    [[nodiscard]] std::string_view task() const noexcept { return task_; }
    [[nodiscard]] std::span<const std::string_view> parameters() const noexcept {
        return {parameters_.data(), parameters_.size()};
    }

  private:
    std::string_view target_;
    std::string_view task_;
    boost::container::static_vector<std::string_view, protocol::max_parameters> parameters_;
    std::string decoded_;
};

/// One right, `VERBS NOUN` (docs/protocol_security.md, "Rights").
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
