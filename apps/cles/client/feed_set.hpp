// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/call_options.hpp>
#include <cles/convert.hpp>
#include <cles/feed.hpp>

#include <boost/asio/awaitable.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

namespace tool {

class client;

/// The bindings of several nouns, whose events go to one function.
class feed_set {
  public:
    using item = cles::feed_item<cles::json_text>;
    /// An event of a noun. \return false if no more is wanted
    using receiver = std::function<bool(const std::string& noun, const item& what)>;
    /// A noun has been bound; its events follow.
    using bound_function = std::function<void(const std::string& noun)>;

    /// What happens if a noun cannot be bound.
    enum class failing : std::uint8_t {
        ends,                ///< that ends all
        waits,               ///< while it or its publisher is not there, it is tried again; another failure ends all
        leaves_out,          ///< that is noted, and the noun left out; if no other noun is left, it ends all
        waits_or_leaves_out, ///< tried again as above; another failure is noted, and the noun left out
    };

    feed_set(client& requester, receiver on_item, bound_function on_bound = {});
    feed_set(const feed_set&) = delete;
    feed_set& operator=(const feed_set&) = delete;
    /// Unbinds all.
    ~feed_set();

    void add(const std::string& noun, const cles::bind_options& options, failing how);
    /// Whether the noun was added.
    [[nodiscard]] bool contains(const std::string& noun) const;
    [[nodiscard]] std::size_t size() const noexcept;

    /// Waits until then, or until no more is wanted. \return whether that is so
    /// \throws the failure of a noun that ends all, what the receiver throws, and when it is interrupted
    boost::asio::awaitable<bool> wait_until(std::chrono::steady_clock::time_point when);

  private:
    class state;

    std::shared_ptr<state> state_; // outlives this while operations end
};

} // namespace tool
