// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>

#include "node/publish/feed_links.hpp"
#include "node/publish/feed_mailbox.hpp"
#include "simulation/world/node_run.hpp"

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::simulation {

/// The origin of a published body, from its content.
struct published_mark {
    std::uint64_t number = 0; ///< of its noun, from 1; 0 if the body contains none
    unsigned run = 0;         ///< of the publisher
};

/// A program that has a feed: fetches updates quickly, slowly, or not for a while, and records them.
class follower : public std::enable_shared_from_this<follower> {
  public:
    struct manner {
        std::uint32_t label;
        std::string target; ///< a node's name; in the group also "all"
        std::string path;
        std::chrono::milliseconds slow{0};
        bool by_group = false; // this and the next one follow from the function that makes it
        bool thinned = false;
    };
    follower(const follower&) = delete;
    follower& operator=(const follower&) = delete;
    virtual ~follower() = default;

    virtual void start() = 0;
    virtual void close() = 0;
    /// Stops fetching for this time.
    void hold(std::chrono::milliseconds time);

    [[nodiscard]] node_run& at() noexcept { return node_; }
    [[nodiscard]] const manner& how() const noexcept { return how_; }
    [[nodiscard]] std::string name() const;
    /// It was bound and has not been closed, so it has to receive what is published.
    [[nodiscard]] bool is_open() { return begun_ && !mail().closed(); }
    /// Whether it has to receive what that node publishes.
    [[nodiscard]] bool wants(std::string_view node) const noexcept {
        return node != node_.name() && (how_.target == "all" || how_.target == node);
    }
    [[nodiscard]] std::uint64_t seen() const noexcept { return seen_; }
    /// The last update of that publisher that it received.
    [[nodiscard]] published_mark last_of(const std::string& publisher) { return sources_[publisher].last; }

  protected:
    follower(node_run& at, manner how) : node_(at), local_(at.shared_local()), how_(std::move(how)) {}

    /// Starts fetching.
    void begin();
    /// Kept alive, as a feed keeps its service.
    [[nodiscard]] core::local_node& local() noexcept { return *local_; }
    void complain(rule which, const std::string& what) { node_.watcher().broken(which, name() + " " + what); }

  private:
    class next_event;
    struct source {
        published_mark last;
        std::uint64_t missed = 0; // reported since then
    };

    virtual core::feed_mailbox& mail() = 0;
    void fetch();
    void take(const detail::raw_event& event);
    void on_gap(const detail::raw_event& event);
    void on_update(const detail::raw_event& event);
    [[nodiscard]] std::string publisher_of(const detail::raw_event& event) const {
        return how_.by_group ? std::string{event.publisher} : how_.target;
    }

    node_run& node_;
    std::shared_ptr<core::local_node> local_;
    manner how_;
    std::map<std::string, source> sources_;
    std::uint64_t shed_ = 0; // reported as missed, of an unknown publisher
    std::uint64_t seen_ = 0;
    bool begun_ = false;
    bool waits_ = false;
    bool held_ = false;
    bool fetch_planned_ = false;
};

/// A feed over a link to the publisher, whose URL is in the terms.
std::shared_ptr<follower> follow_by_link(node_run& at, follower::manner how, core::feed_terms terms);
/// A feed in the multicast group.
std::shared_ptr<follower> follow_by_group(node_run& at, follower::manner how);

} // namespace cles::simulation
