// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "protocol/grammar.hpp"

#include <boost/container/static_vector.hpp>

#include <span>
#include <string>
#include <string_view>

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

} // namespace cles::security
