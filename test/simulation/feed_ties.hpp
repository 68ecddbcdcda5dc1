// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/feed_machine.hpp"
#include "simulation/connection.hpp"
#include "simulation/route.hpp"

#include <cstdint>
#include <map>
#include <memory>
#include <string>

namespace cles::simulation {

class node_run;

/// What a feed is bound to, and how.
struct feed_terms {
    std::string noun;
    unsigned to = 0;
    carrier by = carrier::stream;
    std::uint32_t every_ms = 0;
    std::uint32_t keep = 0;
};

/// The feeds of a node and the links that they are on. Does what shell/feed_links.hpp does; the two are to be kept
/// alike.
class feed_ties final : public core::feed_host {
  public:
    explicit feed_ties(node_run& host) noexcept : node_(host) {}

    /// `alive`: ends with whoever owns the feed.
    void enter(core::feed_machine& feed, std::weak_ptr<void> alive, feed_terms terms);
    void leave(core::feed_machine& feed) { feeds_.erase(&feed); }
    void bind(core::feed_machine& feed) override;
    void unbind(core::feed_machine& feed) override;
    void detach(core::feed_machine& feed) override;
    void renew(core::feed_machine& feed, time_point until) override;

  private:
    struct entry {
        std::weak_ptr<void> alive;
        feed_terms terms;
        std::weak_ptr<connection> on;
        std::uint64_t asking = 0;
        bool was_bound = false;
    };

    void send_bind(core::feed_machine& feed, const std::shared_ptr<connection>& c);
    [[nodiscard]] protocol::request_text bind_text(entry& e, const connection& c);

    node_run& node_;
    std::map<core::feed_machine*, entry> feeds_;
};

} // namespace cles::simulation
