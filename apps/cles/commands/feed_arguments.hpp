// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/feed.hpp>

#include "client/feed_set.hpp"
#include "options/addresses.hpp"

#include <boost/asio/awaitable.hpp>

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
} // namespace CLI

namespace tool {

class client;

/// The arguments of the commands that bind: to what, where, and for how long.
struct feed_arguments {
    address_book addresses{};
    std::vector<std::string> nouns{}; ///< and patterns
    std::optional<std::chrono::milliseconds> timeout{};
    std::chrono::milliseconds every{0};
    std::chrono::milliseconds duration{0};
    std::uint32_t keep = 0;
    std::uint32_t hops = 8;
    std::uint64_t count = 0;
    bool waits = false;

    /// \return the option of the nouns
    CLI::Option* add_options(CLI::App& command, const std::string& count_help);
    /// \throws usage_error if a noun is not valid, or options exclude each other
    void check() const;
    /// Whether updates of that noun come by multicast: for `all:` without an address, and with --multicast.
    [[nodiscard]] bool is_multicast(const std::string& noun) const;
    /// Whether those of any do.
    [[nodiscard]] bool uses_multicast() const;
    /// Whether there may be several nouns: events are then shown with their noun.
    [[nodiscard]] bool is_of_many() const;
    /// Explains failures, and ends after the duration, if one was given.
    void prepare(client& requester) const;

  private:
    friend boost::asio::awaitable<void> follow(client& requester, const feed_arguments& args,
                                               feed_set::receiver on_item, feed_set::bound_function on_bound);
    /// \param url of its node; empty: as the other options say
    [[nodiscard]] cles::bind_options options(const client& requester, const std::string& noun,
                                             const std::string& url) const;
};

/// Binds the nouns, and those that match the patterns, and passes their events to `on_item` until it returns false.
boost::asio::awaitable<void> follow(client& requester, const feed_arguments& args, feed_set::receiver on_item,
                                    feed_set::bound_function on_bound = {});

/// The same, as many values as `args` says: each goes to `show`, and other events to stderr.
boost::asio::awaitable<void>
follow_values(client& requester, const feed_arguments& args,
              std::function<void(const std::string& noun, const feed_set::item& what)> show);

/// What an event is about.
struct event_source {
    std::string node; ///< that publishes it
    std::string path; ///< what it publishes: "localization"

    [[nodiscard]] std::string noun() const { return node + ":" + path; }
};
event_source source_of(const std::string& noun, const feed_set::item& what);

/// Reports an event of a feed on stderr: updates missed, its publisher lost or found again.
void note_event(const std::string& noun, const cles::feed_item<cles::json_text>& item);

} // namespace tool
