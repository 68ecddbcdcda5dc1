// SPDX-License-Identifier: BSL-1.0
#include "nats/pool_link.hpp"

#include <boost/asio/error.hpp>

#include <algorithm>
#include <utility>

namespace cles::nats {
namespace {

constexpr int lines_per_turn = 1024;

std::size_t memory_of(const std::string& line) { return line.size() + sizeof(std::string); }

std::string address_of(const bridging::bridge_link& which, const std::string& own_pool) {
    using role = bridging::bridge_link::role;
    switch (which.what) {
    case role::publications: return "pool://" + own_pool;
    case role::from_pool: return "pool://" + (which.pool.empty() ? std::string{"programs"} : which.pool);
    case role::to_pool: break;
    }
    return "pool://" + which.pool;
}

} // namespace

pool_link::pool_link(std::weak_ptr<pool_link_owner> by, bridging::bridge_link which, const std::string& own_pool,
                     std::string member)
    : by_(std::move(by)), which_(std::move(which)), peer_(identity_of(which_, own_pool, std::move(member))) {}

identity pool_link::identity_of(const bridging::bridge_link& which, const std::string& own_pool, std::string member) {
    return {.transport = "pool",
            .address = address_of(which, own_pool),
            .name = std::move(member),
            .uid = {},
            .local = false};
}

// Of what waits for NATS, the part that this link has written.
std::size_t pool_link::waiting() const noexcept {
    const auto by = by_.lock();
    if (!by || closed_ || given_.empty()) {
        return 0;
    }
    const auto given = by->given();
    const auto sent = given - std::min<std::uint64_t>(given, by->unsent());
    const auto first = std::ranges::upper_bound(given_, sent, {}, &given_bytes::end);
    return first == given_.end() ? 0 : given_total_ - first->total + std::min(first->size, first->end - sent);
}

// Another link's backlog is not this one's: it would count as one whose peer reads nothing.
std::size_t pool_link::excess() const noexcept {
    const auto by = by_.lock();
    const auto all = by && !closed_ ? by->unsent() : 0;
    return all > capacity ? std::min(all - capacity, waiting()) : 0;
}

void pool_link::note_given(std::uint64_t before) {
    const auto by = by_.lock();
    if (!by) {
        return;
    }
    const auto end = by->given();
    const auto sent = end - std::min<std::uint64_t>(end, by->unsent());
    while (!given_.empty() && given_.front().end <= sent) {
        given_.pop_front();
    }
    const auto size = end - before;
    if (size == 0) {
        return;
    }
    given_total_ += size;
    if (!given_.empty() && given_.back().end == before) {
        given_.back() = {.end = end, .total = given_total_, .size = given_.back().size + size};
    } else {
        given_.push_back({.end = end, .total = given_total_, .size = size});
    }
}

std::uint64_t pool_link::sent() const noexcept { return flushed_ - std::min<std::uint64_t>(flushed_, excess()); }

void pool_link::schedule() {
    if (const auto by = by_.lock(); by && !std::exchange(scheduled_, true)) {
        by->schedule(shared_from_this());
    }
}

void pool_link::start(std::shared_ptr<link_events> owner) {
    owner_ = std::move(owner);
    if (!inbox_.empty() || lost_) {
        schedule();
    }
}

void pool_link::flush() {
    const auto by = by_.lock();
    if (closed_ || output_.empty()) {
        return;
    }
    const auto text = std::exchange(output_, {});
    flushed_ += text.size();
    if (!by || lost_) {
        return;
    }
    const auto before = by->given();
    for (std::string_view left = text; !left.empty() && !closed_;) {
        const auto end = std::min(left.find('\n'), left.size());
        by->on_line(which_, left.substr(0, end));
        left.remove_prefix(std::min(end + 1, left.size()));
    }
    note_given(before);
    was_full_ = was_full_ || waiting() != 0;
    by->on_flushed();
}

void pool_link::on_writable() {
    if (std::exchange(was_full_, false) && owner_) {
        const auto owner = owner_;
        owner->on_writable();
    }
}

void pool_link::pause(bool stop) {
    if (std::exchange(paused_, stop) && !stop && !inbox_.empty()) {
        schedule();
    }
}

void pool_link::finish() {
    if (!closed_ && !std::exchange(finishing_, true)) {
        flush();
        clear_inbox();
        lost_ = true;
        schedule();
    }
}

void pool_link::close() {
    if (!std::exchange(closed_, true)) {
        end();
    }
}

void pool_link::clear_inbox() {
    inbox_.clear();
    inbox_bytes_ = 0;
}

void pool_link::end() {
    const auto keep = shared_from_this();
    clear_inbox();
    owner_.reset();
    if (const auto by = by_.lock()) {
        by->on_closed(*this);
    }
}

// -- from the bridge -----------------------------------------------------------------------------------------------

void pool_link::deliver(std::string line) {
    if (!closed_ && !finishing_ && !lost_) {
        inbox_bytes_ += memory_of(line);
        inbox_.push_back(std::move(line));
        schedule();
    }
}

void pool_link::lose_binding(std::string noun, std::string_view why) {
    if (!closed_ && !lost_) {
        bindings_lost_.emplace_back(std::move(noun), why);
        schedule();
    }
}

void pool_link::lose(std::string_view) {
    if (!closed_ && !std::exchange(lost_, true)) {
        schedule();
    }
}

void pool_link::hand_over_lines(const std::shared_ptr<link_events>& owner) {
    for (int turn = lines_per_turn; turn > 0 && !closed_ && !paused_ && !inbox_.empty(); --turn) {
        const auto line = std::move(inbox_.front());
        inbox_.pop_front();
        inbox_bytes_ -= memory_of(line);
        received_ += line.size() + 1;
        owner->on_line(line);
    }
}

void pool_link::hand_over() {
    const auto keep = shared_from_this();
    const auto owner = owner_;
    scheduled_ = false;
    if (closed_ || !owner) {
        return;
    }
    const bool had_lines = !inbox_.empty();
    hand_over_lines(owner);
    if (had_lines && !closed_) {
        owner->on_batch();
    }
    if (closed_) {
        return;
    }
    if (!inbox_.empty() && !paused_) {
        schedule();
        return;
    }
    for (const auto& [noun, why] : std::exchange(bindings_lost_, {})) {
        if (!lost_ && !closed_) {
            owner->on_binding_lost(noun, why);
        }
    }
    if (lost_ && !closed_) {
        closed_ = true;
        end();
        owner->on_lost(boost::asio::error::connection_reset);
    }
}

} // namespace cles::nats
