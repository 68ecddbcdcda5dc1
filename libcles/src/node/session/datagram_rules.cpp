// SPDX-License-Identifier: BSL-1.0
#include "node/session/datagram_rules.hpp"

#include "node/session/reply_writer.hpp"

#include <algorithm>

namespace cles::core {

// -- requests ------------------------------------------------------------------------------------------------------

dedup::~dedup() {
    for (const auto& [id, e] : entries_) {
        shared_.used -= e.cost;
    }
}

const dedup::entry* dedup::find(std::uint64_t id, std::string_view bytes) const {
    const auto [first, last] = entries_.equal_range(id);
    const auto found = std::find_if(first, last, [bytes](const auto& each) { return each.second.bytes() == bytes; });
    return found == last ? nullptr : &found->second;
}

dedup::verdict dedup::look(std::uint64_t id, std::string_view bytes) const {
    if (const auto* known = find(id, bytes)) {
        return known->running ? verdict::running : verdict::answered;
    }
    const auto [first, last] = entries_.equal_range(id);
    const bool runs = std::any_of(first, last, [](const auto& each) { return each.second.running; });
    return runs ? verdict::clash : verdict::fresh;
}

std::string_view dedup::reply(std::uint64_t id, std::string_view bytes) const {
    const auto* known = find(id, bytes);
    return known == nullptr ? std::string_view{} : std::string_view{known->text}.substr(known->request);
}

bool dedup::begin(std::uint64_t id, std::string_view bytes, std::size_t max_reply) {
    const auto cost = cost_of_entry + bytes.size() + max_reply;
    if (shared_.used + cost > shared_.limit) {
        return false;
    }
    enter(id, bytes, true, cost);
    return true;
}

void dedup::add_repeatable(std::uint64_t id, std::string_view bytes) {
    enter(id, bytes, false, cost_of_entry + bytes.size());
}

void dedup::enter(std::uint64_t id, std::string_view bytes, bool once, std::size_t cost) {
    const auto at = entries_.emplace(id, entry{.text = std::string{bytes}, .request = bytes.size(), .once = once});
    charge(at->second, cost);
}

void dedup::charge(entry& e, std::size_t cost) noexcept {
    shared_.used = shared_.used - e.cost + cost;
    e.cost = cost;
}

void dedup::forget(entries::iterator which) noexcept {
    charge(which->second, 0);
    entries_.erase(which);
}

void dedup::set_reply(std::uint64_t id, std::string_view reply, time_point now) {
    const auto [first, last] = entries_.equal_range(id);
    const auto at = std::find_if(first, last, [](const auto& each) { return each.second.running; });
    if (at == last) {
        return;
    }
    auto& e = at->second;
    if (!e.once) {
        forget(at);
        return;
    }
    e.running = false;
    e.text.append(reply);
    charge(e, cost_of_entry + e.text.size());
    done_.push_back({at, now + memory});
    if (!armed()) {
        deadlines_.arm(*this, done_.front().until);
    }
}

void dedup::on_deadline(time_point now) {
    while (!done_.empty() && done_.front().until <= now) {
        forget(done_.front().which);
        done_.pop_front();
    }
    if (!done_.empty()) {
        deadlines_.arm(*this, done_.front().until);
    }
}

bool admit_datagram(const protocol::request_line& r, dedup& seen, node_state& host, line_sink& out,
                    reply_writer& replies) {
    // A copy of a signed PULL must neither run again nor get another challenge.
    const auto* const task = host.secured ? host.tasks.find(r.verb, r.noun.task) : nullptr;
    const bool is_signed = task != nullptr && task->info.must_be_signed;
    const bool needs_id = r.verb != verb::bind && (r.verb != verb::pull || is_signed);
    if (r.id == 0) {
        if (needs_id) {
            replies.fail(r, errc::bad_request,
                         host.name + ": by datagram, " + std::string{to_string(r.verb)} + " needs an 'id'");
        }
        return !needs_id;
    }
    switch (seen.look(r.id, r.text)) {
    case dedup::verdict::fresh: break;
    case dedup::verdict::running: ++host.counts.requests_repeated; return false;
    case dedup::verdict::answered:
        ++host.counts.requests_repeated;
        out.output().append(seen.reply(r.id, r.text));
        return false;
    case dedup::verdict::clash:
        reply_target where{r};
        where.apart = true;
        replies.fail(
            where, {.code = errc::bad_request,
                    .message = host.name + ": the id " + std::to_string(r.id) + " is in flight with another request"});
        return false;
    }
    // A cancellation may be repeated, and takes effect even if no memory is left.
    if (needs_id && r.noun.task != "cles" && !seen.begin(r.id, r.text, out.datagram())) {
        replies.fail(r, {.code = errc::busy,
                         .message = host.name + " has reached its limit of requests by datagram",
                         .retry_ms = 1000});
        return false;
    }
    return true;
}

// -- output --------------------------------------------------------------------------------------------------------

bool reflection_limit::admit(std::string_view address, std::size_t bytes, time_point now) {
    auto* b = find_or_make(address, now);
    if (b == nullptr) {
        return false;
    }
    b->fill(now);
    if (b->tokens < static_cast<double>(bytes)) {
        return false;
    }
    b->tokens -= static_cast<double>(bytes);
    return true;
}

void reflection_limit::bucket::fill(time_point now) noexcept {
    const auto passed = std::chrono::duration<double>{now - at}.count();
    tokens = std::min(tokens + passed * static_cast<double>(bytes_per_second), static_cast<double>(at_once));
    at = now;
}

reflection_limit::bucket* reflection_limit::find_or_make(std::string_view address, time_point now) {
    if (const auto found = buckets_.find(address); found != buckets_.end()) {
        return &found->second;
    }
    if (buckets_.size() >= max_addresses) {
        forget_full(now);
        if (buckets_.size() >= max_addresses) {
            return nullptr; // too many addresses to track: the newest get nothing
        }
    }
    return &buckets_.emplace(std::string{address}, bucket{.at = now}).first->second;
}

// An address whose bucket is full needs no entry. Searched at most every 100 ms, so that a flood of forged addresses
// does not cost a search each.
void reflection_limit::forget_full(time_point now) {
    if (now - tidied_ < std::chrono::milliseconds{100}) {
        return;
    }
    tidied_ = now;
    boost::unordered::erase_if(buckets_, [now](auto& each) {
        each.second.fill(now);
        return each.second.tokens >= static_cast<double>(at_once);
    });
}

void datagram_output::append_updates(std::string& out, std::string_view lines) {
    while (!lines.empty()) {
        const auto size = lines.find('\n') + 1; // updates are whole lines
        if (size <= max_datagram_) {
            out.append(lines.substr(0, size));
        } else {
            ++node_.counts.updates_too_large;
        }
        lines.remove_prefix(size);
    }
}

void datagram_output::limit(std::string& out, time_point now) {
    if (unverified_address_.empty()) {
        return;
    }
    std::size_t kept = 0;
    for (std::size_t at = 0; at < out.size();) {
        const auto size = out.find('\n', at) + 1 - at;
        if (node_.reflection.admit(unverified_address_, size + headers_, now)) {
            out.replace(kept, size, out, at, size);
            kept += size;
        } else {
            ++node_.counts.datagrams_withheld;
        }
        at += size;
    }
    out.resize(kept);
}

} // namespace cles::core
