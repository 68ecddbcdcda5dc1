// SPDX-License-Identifier: BSL-1.0
#include "node/publish/group_feeds.hpp"

#include "node/publish/multicast_group.hpp"

#include <boost/container/small_vector.hpp>

#include <algorithm>
#include <chrono>
#include <iterator>

namespace cles::core {
namespace {

std::string noun_of(const group_feed& feed) { return feed.target() + ":" + feed.path(); }

} // namespace

void group_feeds::add(group_feed& feed, time_point now) {
    by_path_[feed.path()].push_back(&feed);
    const auto [at, is_new] = bound_.try_emplace(noun_of(feed), *this, noun_of(feed));
    if (is_new) {
        send_bind(at->second, now);
    }
    ++at->second.feeds;
}

std::chrono::milliseconds group_feeds::lease() const {
    return std::clamp(node_.bounds.lease, std::chrono::milliseconds{1},
                      std::chrono::milliseconds{protocol::max_lease_ms});
}

std::string group_feeds::bind_line(const bound& b) const {
    std::string line;
    protocol::append_request(
        line, {.verb = verb::bind, .noun = b.noun, .lease_ms = static_cast<std::uint32_t>(lease().count())});
    return line;
}

void group_feeds::bind_on(group_port& added) {
    for (const auto& [noun, b] : bound_) {
        out_.send(added, bind_line(b));
    }
}

// A BIND that is lost is replaced by the next one.
void group_feeds::send_bind(bound& b, time_point now) {
    out_.send(bind_line(b));
    const auto third = lease() / 3;
    node_.deadlines.arm(b,
                        saturating_add(now, std::max(third - jitter_.quarter_of(third), std::chrono::milliseconds{1})));
}

// A short delay, so that one BIND reaches several nodes that start together.
void group_feeds::rebind_soon(std::string_view node, time_point now) {
    constexpr std::chrono::milliseconds soon{50};
    for (auto& [noun, b] : bound_) {
        const auto target = std::string_view{noun}.substr(0, noun.find(':'));
        const auto due = now + soon - jitter_.quarter_of(soon);
        if ((target == node || target == "all") && due < b.due()) {
            node_.deadlines.arm(b, due);
        }
    }
}

bool group_feeds::wants(const protocol::request_line& update) const {
    std::string scratch;
    const auto found = by_path_.find(protocol::canonical_path(update.noun, scratch));
    return found != by_path_.end() &&
           std::ranges::any_of(found->second, [&](const auto* f) { return f->wants(update.noun.target); });
}

void group_feeds::forget(std::string_view node) {
    for (const auto& [path, feeds] : by_path_) {
        for (auto* feed : feeds) {
            feed->forget(node);
        }
    }
}

// A publisher holds one lease for this node and noun, whichever target was used: it stays while another feed needs it.
void group_feeds::unbind(const group_feed& last) {
    const bool asked_all = last.target() == "all";
    if (!asked_all && bound_.contains("all:" + last.path())) {
        return;
    }
    std::string line;
    protocol::append_request(line, {.verb = verb::bind, .noun = noun_of(last), .lease_ms = 0});
    out_.send(line);
    if (asked_all) {
        const auto now = node_.time.now();
        for (const auto* other : by_path_.at(last.path())) {
            send_bind(bound_.at(noun_of(*other)), now);
        }
    }
}

void group_feeds::remove(group_feed& feed) {
    const auto found = by_path_.find(feed.path());
    if (found == by_path_.end() || std::erase(found->second, &feed) == 0) {
        return;
    }
    if (const auto b = bound_.find(noun_of(feed)); --b->second.feeds == 0) {
        bound_.erase(b);
        unbind(feed);
    }
    if (found->second.empty()) {
        by_path_.erase(found);
    }
}

std::vector<group_feed*> group_feeds::remove_all() {
    std::vector<group_feed*> all;
    for (const auto& [path, feeds] : by_path_) {
        std::ranges::copy(feeds, std::back_inserter(all));
    }
    for (auto* feed : all) {
        remove(*feed);
    }
    return all;
}

bool group_feeds::has(std::string_view path, const group_feed* feed) const {
    const auto found = by_path_.find(path);
    return found != by_path_.end() && std::ranges::find(found->second, feed) != found->second.end();
}

bool group_feeds::take(const protocol::request_line& update) {
    std::string scratch;
    const auto path = protocol::canonical_path(update.noun, scratch);
    const auto found = by_path_.find(path);
    if (found == by_path_.end()) {
        return false;
    }
    boost::container::small_vector<group_feed*, 8> wanting;
    std::ranges::copy_if(found->second, std::back_inserter(wanting),
                         [&](const auto* feed) { return feed->wants(update.noun.target); });
    // User code may close feeds and add new ones. So the last feed (usually the only one) receives the update when
    // nothing of this is used any more, and the others later, unless their operations are the library's own.
    bool taken = false;
    for (auto* feed : wanting) {
        if (feed == wanting.front() || has(path, feed)) { // not closed meanwhile
            const auto when = feed == wanting.back() ? feed_mailbox::hand_over::now : feed_mailbox::hand_over::later;
            taken = feed->take(update, when) || taken;
        }
    }
    return taken;
}

} // namespace cles::core
