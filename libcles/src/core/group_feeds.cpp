// SPDX-License-Identifier: BSL-1.0
#include "core/group_feeds.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace cles::core {
namespace {

std::string noun_of(const group_feed& feed) { return feed.target() + ":" + feed.path(); }

} // namespace

group_feeds::group_feeds(node& host, group_output& out, std::uint32_t seed) noexcept
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

// One that is lost on its way is made up for by the next.
void group_feeds::send_bind(bound& b, time_point now) {
    const auto lease =
        std::clamp(node_.bounds.lease, std::chrono::milliseconds{1}, std::chrono::milliseconds{protocol::max_lease_ms});
    std::string line;
    protocol::append_request(
        line, {.verb = verb::bind, .noun = b.noun, .lease_ms = static_cast<std::uint32_t>(lease.count())});
    out_.send(line);
    const auto third = lease / 3;
    node_.deadlines.arm(b, now + std::max(third - jitter_.quarter_of(third), std::chrono::milliseconds{1}));
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
    // A publisher holds one lease for this node and noun, however it was asked for: it stays while another feed wants
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
    if (handing_out_ != 0) {
        *place = nullptr;
    } else {
        feeds.erase(place);
    }
    release(feed);
    if (feeds.empty()) {
        by_path_.erase(found);
    }
}

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
    // Whoever is told may close feeds and make new ones. So the last is told when nothing here is looked at any more
    // (mostly it is the only one), and the others later, unless they are the library's own.
    struct holding {
        explicit holding(int& count) noexcept : depth(count) { ++depth; }
        holding(const holding&) = delete;
        holding& operator=(const holding&) = delete;
        ~holding() { --depth; }
        int& depth;
    };
    auto& feeds = found->second;
    const auto wants = [&](const group_feed* feed) { return feed != nullptr && feed->wants(update.noun.target); };
    const auto behind_last = std::find_if(feeds.rbegin(), feeds.rend(), wants).base();
    if (behind_last == feeds.begin()) {
        return false;
    }
    bool taken = false;
    const auto last_at = static_cast<std::size_t>(behind_last - feeds.begin()) - 1;
    {
        const holding on{handing_out_};
        // NOLINTNEXTLINE(modernize-loop-convert): what is added meanwhile may move the others
        for (std::size_t i = 0; i < last_at; ++i) {
            if (wants(feeds[i])) {
                taken = feeds[i]->take(update, feed_mailbox::hand_over::later) || taken;
            }
        }
    }
    auto* const last = feeds[last_at];
    if (handing_out_ == 0) {
        std::erase(feeds, nullptr);
        if (feeds.empty()) {
            by_path_.erase(found);
        }
    }
    return (last != nullptr && last->take(update)) || taken;
}

} // namespace cles::core
