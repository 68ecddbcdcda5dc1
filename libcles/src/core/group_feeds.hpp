// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/deadlines.hpp"
#include "core/group_feed.hpp"
#include "core/group_output.hpp"
#include "core/jitter.hpp"
#include "core/node.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// The feeds of a node that are bound by the multicast group. Sends BIND when the first feed of a noun comes, again at
/// a third of the lease, and lease=0 when the last has gone; hands each update to all feeds that want it.
class group_feeds {
  public:
    group_feeds(node& host, group_sender& out, std::uint32_t seed) noexcept;

    /// The feed stays until it is removed.
    void add(group_feed& feed, time_point now);
    /// Does nothing where it is not there (any more).
    void remove(group_feed& feed);
    /// Removes all, and says which they were.
    [[nodiscard]] std::vector<group_feed*> remove_all();
    /// The node of that name has begun anew, and knows of no binding: what is bound there, or at all, is soon bound
    /// again.
    void on_new_run(std::string_view node, time_point now);
    /// Whether a feed is bound to what it is an update of.
    [[nodiscard]] bool wants(const protocol::request_line& update) const;
    /// The next update of that node is the first.
    void forget(std::string_view node);
    /// Hands an update on. False where nobody wants it, or it is not news to anybody.
    bool take(const protocol::request_line& update);
    /// Nothing is kept of any feed.
    [[nodiscard]] bool empty() const noexcept { return by_path_.empty() && bound_.empty(); }

  private:
    class handing_out;

    struct bound final : deadline { // due when it is to be renewed
        bound(group_feeds& all, std::string what) : owner(all), noun(std::move(what)) {}
        void on_deadline(time_point now) override { owner.send_bind(*this, now); }

        group_feeds& owner;
        std::string noun; // as it stands on the wire
        std::size_t feeds = 0;
    };

    void send_bind(bound& b, time_point now);
    void send_unbind(const std::string& noun);
    void release(const group_feed& feed);

    node& node_;
    group_sender& out_;
    jitter jitter_;
    std::map<std::string, std::unique_ptr<bound>, std::less<>> bound_;
    std::map<std::string, std::vector<group_feed*>, std::less<>> by_path_; // null: removed while updates are handed out
    int depth_ = 0;                                                        // of handing out
    bool holes_ = false;                                                   // there are such
};

} // namespace cles::core
