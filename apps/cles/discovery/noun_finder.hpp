// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "options/noun_pattern.hpp"

#include <boost/asio/awaitable.hpp>

#include <chrono>
#include <exception>
#include <string>
#include <string_view>
#include <vector>

namespace tool {

class address_book;
class client;

/// A noun that a node publishes.
struct found_noun {
    std::string noun;
    std::string url{}; ///< of its node; empty: it is found by its name, or where the command's options say
};

/// The paths in a node's answer to PULL self:cles/nouns. \throws cles::error with `conversion`
std::vector<std::string> paths_in(std::string_view nouns);
/// The tasks that can be bound, in its answer to PULL self:cles: of a node that does not tell its nouns.
std::vector<std::string> bindable_tasks_in(std::string_view description);

/// Finds the nouns that match patterns, by asking nodes what they publish.
class noun_finder {
  public:
    /// How long nodes are waited for.
    static constexpr std::chrono::milliseconds patience{1000};

    /// The patterns are no nouns. All of these must outlive this.
    noun_finder(client& requester, const address_book& addresses, const std::vector<noun_pattern>& patterns)
        : requester_(requester), addresses_(addresses), patterns_(patterns) {}

    /// Those that match now; nodes that do not answer in time are left out. Takes as long as nodes announce themselves.
    /// \throws cles::error with `cancelled`
    boost::asio::awaitable<std::vector<found_noun>> find();
    /// Why a node that a pattern names could not be asked last; null if all could.
    [[nodiscard]] const std::exception_ptr& failure() const noexcept { return failure_; }

  private:
    boost::asio::awaitable<void> ask_one(const noun_pattern& pattern, std::vector<found_noun>& found);
    boost::asio::awaitable<void> ask_many(std::vector<found_noun>& found);

    client& requester_;
    const address_book& addresses_;
    const std::vector<noun_pattern>& patterns_;
    std::exception_ptr failure_;
    bool has_left_out_ = false; // nodes, since there are too many
};

} // namespace tool
