// SPDX-License-Identifier: BSL-1.0
#include "node/publish/group_feeds.hpp"

#include "node/base/deadlines.hpp"
#include "node/publish/sequence_tracker.hpp"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <utility>

namespace cles::core {
namespace {

std::string noun_of(const group_feed& feed) { return feed.target() + ":" + feed.path(); }

} // namespace

group_feeds::group_feeds(node_state& host, group_sender& out, std::uint32_t seed) noexcept
    : node_(host), out_(out), jitter_(seed) {}

void group_feeds::add(group_feed& feed, time_point now) {
    by_path_[feed.path()].push_back(&feed);
    auto& b = bound_[noun_of(feed)];
    if (!b) {
        b = std::make_unique<bound>(*this, noun_of(feed));
        send_bind(*b, now);
    }
    ++b->feeds;
}

// A BIND that is lost is replaced by the next one.
void group_feeds::send_bind(bound& b, time_point now) {
    const auto lease =
        std::clamp(node_.bounds.lease, std::chrono::milliseconds{1}, std::chrono::milliseconds{protocol::max_lease_ms});
    std::string line;
    protocol::append_request(
        line, {.verb = verb::bind, .noun = b.noun, .lease_ms = static_cast<std::uint32_t>(lease.count())});
    out_.send(line);
    const auto third = lease / 3;
    node_.deadlines.arm(b,
                        saturating_add(now, std::max(third - jitter_.quarter_of(third), std::chrono::milliseconds{1})));
}

// A short delay, so that one BIND reaches several nodes that start together.
void group_feeds::on_new_incarnation(std::string_view node, time_point now) {
    constexpr std::chrono::milliseconds soon{50};
    const auto is_of = [](std::string_view noun, std::string_view target) {
        return noun.size() > target.size() && noun.starts_with(target) && noun[target.size()] == ':';
    };
    for (const auto& [noun, b] : bound_) {
        const auto due = now + soon - jitter_.quarter_of(soon);
        if ((is_of(noun, node) || is_of(noun, "all")) && due < b->due()) {
            node_.deadlines.arm(*b, due);
        }
    }
}

bool group_feeds::wants(const protocol::request_line& update) const {
    std::string scratch;
    const auto found = by_path_.find(protocol::canonical_path(update.noun, scratch));
    return found != by_path_.end() && std::any_of(found->second.begin(), found->second.end(), [&](const group_feed* f) {
               return f != nullptr && f->wants(update.noun.target);
           });
}

void group_feeds::forget(std::string_view node) {
    for (const auto& [path, feeds] : by_path_) {
        for (auto* feed : feeds) {
            if (feed != nullptr) {
                feed->forget(node);
            }
        }
    }
}

void group_feeds::send_unbind(const std::string& noun) {
    std::string line;
    protocol::append_request(line, {.verb = verb::bind, .noun = noun, .lease_ms = 0});
    out_.send(line);
}

void group_feeds::release(const group_feed& feed) {
    const auto found = bound_.find(noun_of(feed));
    if (--found->second->feeds != 0) {
        return;
    }
    bound_.erase(found);
    // A publisher holds one lease for this node and noun, whichever target was used: it stays while another feed needs
    // it.
    const auto& all = by_path_.at(feed.path());
    const auto now = node_.time.now();
    const bool asked_all = feed.target() == "all";
    if (!asked_all && bound_.contains("all:" + feed.path())) {
        return;
    }
    send_unbind(noun_of(feed));
    if (asked_all) {
        for (const auto* other : all) {
            if (other != nullptr) {
                send_bind(*bound_.at(noun_of(*other)), now);
            }
        }
    }
}

void group_feeds::remove(group_feed& feed) {
    const auto found = by_path_.find(feed.path());
    if (found == by_path_.end()) {
        return;
    }
    auto& feeds = found->second;
    const auto place = std::find(feeds.begin(), feeds.end(), &feed);
    if (place == feeds.end()) {
        return;
    }
    if (depth_ != 0) {
        *place = nullptr;
        holes_ = true;
    } else {
        feeds.erase(place);
    }
    release(feed);
    if (feeds.empty()) {
        by_path_.erase(found);
    }
}

/// Callbacks may add and remove feeds of any noun, or throw. Removed feeds leave null entries until the delivery ends.
class group_feeds::delivery_guard {
  public:
    explicit delivery_guard(group_feeds& of) noexcept : of_(of) { ++of_.depth_; }
    delivery_guard(const delivery_guard&) = delete;
    delivery_guard& operator=(const delivery_guard&) = delete;
    ~delivery_guard() {
        if (--of_.depth_ == 0 && std::exchange(of_.holes_, false)) {
            for (auto at = of_.by_path_.begin(); at != of_.by_path_.end();) {
                std::erase(at->second, nullptr);
                at = at->second.empty() ? of_.by_path_.erase(at) : std::next(at);
            }
        }
    }

  private:
    group_feeds& of_;
};

std::vector<group_feed*> group_feeds::remove_all() {
    std::vector<group_feed*> all;
    for (const auto& [path, feeds] : by_path_) {
        std::copy_if(feeds.begin(), feeds.end(), std::back_inserter(all), [](const auto* f) { return f != nullptr; });
    }
    for (auto* feed : all) {
        remove(*feed);
    }
    return all;
}

bool group_feeds::take(const protocol::request_line& update) {
    std::string scratch;
    const auto found = by_path_.find(protocol::canonical_path(update.noun, scratch));
    if (found == by_path_.end()) {
        return false;
    }
    // User code may close feeds and add new ones. So the last feed (usually the only one) receives the update when the
    // list is no longer used, and the others later, unless their operations are the library's own.
    const auto& feeds = found->second;
    const auto wants = [&](const group_feed* feed) { return feed != nullptr && feed->wants(update.noun.target); };
    const auto behind_last = std::find_if(feeds.rbegin(), feeds.rend(), wants).base();
    if (behind_last == feeds.begin()) {
        return false;
    }
    const auto last_at = static_cast<std::size_t>(behind_last - feeds.begin()) - 1;
    bool taken = false;
    group_feed* last = nullptr;
    {
        const delivery_guard on{*this};
        // NOLINTNEXTLINE(modernize-loop-convert): what is added meanwhile may move the others
        for (std::size_t i = 0; i < last_at; ++i) {
            if (wants(feeds[i])) {
                taken = feeds[i]->take(update, feed_mailbox::hand_over::later) || taken;
            }
        }
        last = feeds[last_at];
    }
    return (last != nullptr && last->take(update)) || taken;
}

bool group_feed::take(const protocol::request_line& update, feed_mailbox::hand_over when) {
    auto& order = publishers_.of(update.noun.target);
    const auto before = order;
    const auto arrived = order.accept(update, false);
    if (arrived.gap) {
        mail_.put(*arrived.gap, when);
    }
    // After delivery, `order` may be gone: the handler may have closed the feed.
    if (arrived.is_new && !mail_.put(arrived.event, when)) {
        order = before;
        return false;
    }
    return arrived.is_new;
}

} // namespace cles::core
