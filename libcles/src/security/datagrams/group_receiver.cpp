// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/group_receiver.hpp"

#include "security/datagrams/group_sender.hpp"

#include <algorithm>
#include <chrono>

#include <sodium.h>

namespace cles::security {
namespace {

constexpr std::chrono::seconds between_contacts{1};
constexpr std::size_t max_newer = 16;

} // namespace

group_receiver::group_receiver(fleet& of, group_sender& own, entropy& random)
    : fleet_(of), own_(own), random_(random), observation_(of.observe([this](const roster&) { newer_.clear(); })),
      salts_(of) {}

void group_receiver::learn(std::uint32_t member, const node_statement& stated) {
    salts_.learn(member, stated.salt, stated.epoch, stated.counter);
}

group_receiver::result group_receiver::open(const datagram_path& from, bytes_view datagram, time_point now) {
    const auto head = read_head(datagram);
    const auto* const self = fleet_.self();
    if (!head || head->kind != datagram_kind::group || self == nullptr ||
        fleet_.in_force().find(head->sender) == nullptr) {
        return {};
    }
    const datagram_source source{.path = from, .member = head->sender};
    if (fleet_.ring().is_future(head->generation)) {
        return {.contact = newer_roster(source, now)};
    }
    const auto* const key = fleet_.ring().find(head->generation);
    if (key == nullptr || (head->sender == self->number && head->salt == own_.salt()) ||
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
    while (!contacted_.empty() && now - contacted_.front().at >= between_contacts) {
        contacted_.pop_front();
    }
    if (std::ranges::find(contacted_, source, &recent_contact::source) != contacted_.end() || !contacts_.take(now)) {
        return false;
    }
    contacted_.push_back({.source = source, .at = now});
    return true;
}

// Nobody can tell whether such a datagram is authentic. A random one of the sources is asked, so that those who are not
// members do not decide which.
std::optional<datagram_source> group_receiver::newer_roster(const datagram_source& source, time_point now) {
    if (std::ranges::find(newer_, source) == newer_.end()) {
        if (newer_.size() < max_newer) {
            newer_.push_back(source);
        } else {
            newer_[random_.draw<std::uint32_t>() % newer_.size()] = source;
        }
    }
    if (!roster_contacts_.take(now)) {
        return {};
    }
    return newer_[random_.draw<std::uint32_t>() % newer_.size()];
}

} // namespace cles::security
