// SPDX-License-Identifier: BSL-1.0
#include "node/publish/group_bindings.hpp"

#include <cles/error.hpp>

#include "node/publish/multicast_group.hpp"

#include <algorithm>

namespace cles::core {
namespace {

// A node's own burst waits here while the socket is not writable. A subscriber's `keep` has no effect.
constexpr binding::terms group_terms{.every = std::chrono::milliseconds{0}, .keep = 1024};

} // namespace

group_bindings::group_bindings(node_state& host, group_port& out, std::uint32_t seed)
    : node_(host), out_(out), jitter_(seed), bound_(host.published, *this),
      leases_(host.deadlines, [this](const auto& expired) {
          ++node_.counts.leases_expired;
          end(*expired.first, expired.second);
      }) {
    node_.published.watch(*this);
}

group_bindings::~group_bindings() { clear(); }

void group_bindings::clear() {
    node_.published.unwatch(*this);
    leases_.clear();
    nouns_.clear();
    for (const auto& [source, count] : of_source_) {
        node_.counts.group_leases -= count;
    }
    of_source_.clear();
    bound_.clear();
}

bool group_bindings::has_capacity_for(const group_source& from) const {
    const auto found = of_source_.find(from);
    return node_.counts.group_leases < node_.bounds.group_leases &&
           (found == of_source_.end() || found->second < node_.bounds.bindings);
}

bool group_bindings::bind(const group_source& from, const protocol::request_line& r, time_point now) {
    std::string scratch;
    const auto path = protocol::canonical_path(r.noun, scratch);
    auto found = nouns_.find(path);
    const bool known = found != nouns_.end() && leases_.contains({&found->second, from});
    if (r.unbinds()) {
        if (known) {
            leases_.drop({&found->second, from});
            end(found->second, from);
        }
        return true;
    }
    if (!known) {
        if (!has_capacity_for(from)) {
            return false;
        }
        if (found == nouns_.end()) {
            found = nouns_.try_emplace(std::string{path}, *this, std::string{path}).first;
            if (auto* t = node_.published.find(path)) {
                bound_.bind(*t, group_terms);
            }
        }
        ++found->second.leases;
        ++of_source_[from];
        ++node_.counts.group_leases;
    }
    auto& n = found->second;
    leases_.set({&n, from},
                saturating_add(now, std::chrono::milliseconds{r.lease_ms.value_or(protocol::default_lease_ms)}));
    if (!known) {
        repeat_soon(n, r.noun.target == "all", now);
    }
    return true;
}

// The lease is no longer there.
void group_bindings::end(noun& n, const group_source& from) {
    if (const auto count = of_source_.find(from); --count->second == 0) {
        of_source_.erase(count);
    }
    --node_.counts.group_leases;
    if (--n.leases == 0) {
        // Removed from the map first: publishers that waited for this subscriber continue, and may run any user code.
        const auto gone = nouns_.extract(n.path);
        bound_.unbind(gone.key());
    }
}

void group_bindings::on_opened(topic& made) {
    if (nouns_.contains(made.path())) {
        bound_.bind(made, group_terms);
    }
}

// -- repeating the last update ---------------------------------------------------------------------------------------

void group_bindings::repeat_soon(noun& n, bool delayed, time_point now) {
    const auto* t = node_.published.find(n.path);
    if (t == nullptr || !t->has_value()) {
        return;
    }
    n.repeat_of = t->seq();
    auto due = now + (delayed ? jitter_.quarter_of(4 * repeat_apart) : std::chrono::milliseconds{0});
    if (n.repeated_at) {
        due = std::max(due, *n.repeated_at + repeat_apart);
    }
    if (due <= now) {
        node_.deadlines.disarm(n);
        repeat(n, now);
    } else if (!n.armed() || due < n.due()) {
        node_.deadlines.arm(n, due);
    }
}

void group_bindings::repeat(noun& n, time_point now) {
    auto* t = node_.published.find(n.path);
    if (t == nullptr || t->seq() != n.repeat_of) { // a later one has been sent, or will be
        return;
    }
    if (const auto* b = t->find(*this); b != nullptr && b->is_behind()) { // it has not even been sent once
        bound_.drain(now);
        return;
    }
    n.repeated_at = now;
    put_updates(t->last_line());
}

void group_bindings::put_updates(std::string_view lines) {
    std::size_t begin = 0; // of those that fit and have not been sent
    for (std::size_t at = 0; at < lines.size();) {
        const auto next = lines.find('\n', at) + 1; // updates are whole lines
        if (next - at > protocol::datagram_bytes) {
            send_to(out_, node_, lines.substr(begin, at - begin));
            ++node_.counts.updates_too_large;
            note_too_large(lines.substr(at, next - at));
            begin = next;
        }
        at = next;
    }
    send_to(out_, node_, lines.substr(begin));
}

// Nothing else notifies the publisher; an occasional entry is enough.
void group_bindings::note_too_large(std::string_view line) {
    constexpr std::chrono::seconds apart{10};
    const auto now = node_.time.now();
    if (noted_at_ && now - *noted_at_ < apart) {
        return;
    }
    noted_at_ = now;
    node_.post_log(log_level::warning, std::string{wire_name(errc::too_large)} + ": " +
                                           std::string{line.substr(0, line.find(" seq="))} + " has " +
                                           std::to_string(line.size()) + " bytes, and by multicast at most " +
                                           std::to_string(protocol::datagram_bytes) + " are sent");
}

} // namespace cles::core
