// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/group_receiver.hpp"

#include "security/datagrams/group_sender.hpp"

#include <algorithm>
#include <chrono>

#include <sodium.h>

namespace cles::security {
namespace {

constexpr std::chrono::seconds between_contacts{1};
constexpr std::size_t max_unverified = 16;

} // namespace

group_receiver::group_receiver(fleet& of, group_sender& own, entropy& random)
    : fleet_(of), own_(own), random_(random), observation_(of.observe([this](const roster&) {
          newer_.clear();
          older_.clear();
      })),
      salts_(of) {}

void group_receiver::learn(std::uint32_t member, const node_statement& stated) {
    salts_.learn(member, stated.salt, stated.epoch, stated.counter);
}

group_receiver::result group_receiver::open(const datagram_path& from, bytes_view datagram, time_point now) {
    const auto head = read_head(datagram);
    const auto* const self = fleet_.self();
    if (!head || head->kind != datagram_kind::group || self == nullptr ||
        fleet_.in_force().find(head->sender) == nullptr ||
        (head->sender == self->number && head->salt == own_.salt())) {
        return {};
    }
    const datagram_source source{.path = from, .member = head->sender};
    if (fleet_.ring().is_future(head->generation)) {
        return {.contact = choose(newer_, source, now)};
    }
    if (head->generation < fleet_.in_force().oldest()) {
        return {.outdated = choose(older_, source, now)};
    }
    const auto* const key = fleet_.ring().find(head->generation);
    if (key == nullptr ||
        crypto_aead_xchacha20poly1305_ietf_decrypt(
            opened_.data(), nullptr, nullptr, datagram.data() + group_head_bytes, datagram.size() - group_head_bytes,
            datagram.data(), group_head_bytes, datagram.data() + group_nonce_at, key->data()) != 0) {
        return {};
    }
    result opened{.what = verdict::unknown_salt,
                  .line = as_text({opened_.data(), datagram.size() - group_head_bytes - seal_bytes})};
    if (const auto* const known = salts_.find(head->sender, head->salt)) {
        opened.what = verdict::opened;
        opened.epoch = known->epoch;
        opened.accepted_by = {.member = head->sender, .salt = head->salt, .counter = head->counter};
    } else if (may_contact(source, now)) {
        opened.contact = source;
    }
    return opened;
}

bool group_receiver::accept(const ticket& t, ordered_by order) {
    auto* const known = salts_.find(t.member, t.salt);
    if (known == nullptr) {
        return false;
    }
    if (order == ordered_by::signed_seq) {
        return t.counter >= known->window.first();
    }
    if (!known->window.accepts(t.counter)) {
        return false;
    }
    known->window.note(t.counter);
    return true;
}

core::datagram_admission::repetition group_receiver::accept_announcement(const ticket& t, std::uint64_t seq) {
    using repetition = core::datagram_admission::repetition;
    auto* const known = salts_.find(t.member, t.salt);
    if (known == nullptr || t.counter < known->window.first()) {
        return repetition::refused;
    }
    return salts_.note_announcement(t.member, *known, seq) ? repetition::first : repetition::again;
}

bool group_receiver::may_contact(const datagram_source& source, time_point now) {
    if (contacted_.contains(source, now) || contacts_.take(source.member, now) == member_turns::turn::refused) {
        return false;
    }
    contacted_.add(source, now);
    return true;
}

// A random one, so that those who are not members do not decide which. Their numbers are not authentic either: who can
// send from the address of another could state many, and have this node send HELLO there for each.
std::optional<datagram_source> group_receiver::choose(unverified_sources& among, const datagram_source& latest,
                                                      time_point now) {
    if (!chosen_.contains(latest.path, now) && std::ranges::find(among, latest) == among.end()) {
        if (among.size() < max_unverified) {
            among.push_back(latest);
        } else {
            among[random_.draw<std::uint32_t>() % among.size()] = latest;
        }
    }
    if (among.empty() || !choices_.take(now)) {
        return {};
    }
    const auto chosen = among[random_.draw<std::uint32_t>() % among.size()];
    chosen_.add(chosen.path, now);
    for (auto* const each : {&newer_, &older_}) {
        std::erase_if(*each, [&](const datagram_source& other) { return other.path == chosen.path; });
    }
    return chosen;
}

template <class Source>
bool group_receiver::recent<Source>::contains(const Source& which, time_point now) {
    while (!all_.empty() && now - all_.front().at >= between_contacts) {
        all_.pop_front();
    }
    return std::ranges::find(all_, which, &entry::which) != all_.end();
}

} // namespace cles::security
