// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/half_open_sessions.hpp"

#include "security/keys/bytes.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace cles::security {

namespace {

// The ephemeral key is random.
std::uint64_t beginning_of_key(bytes_view hello) noexcept { return load_big<8>(hello.data() + hello_head_bytes); }

} // namespace

// Two HELLO with the same result cost a second handshake, no more.
std::uint64_t half_open_sessions::key_of(const datagram_path& from, bytes_view hello) noexcept {
    return beginning_of_key(hello) ^ datagram_source::hash{}({.path = from});
}

// \pre the MAC has been verified, so that who forges one uses up no turns of the member
bool half_open_sessions::may_open(const datagram_source& by, bytes_view hello, bool has_mac, time_point now) {
    const auto found = opened_.find(beginning_of_key(hello));
    const auto openings = found == opened_.end() ? 0 : found->second;
    if (openings >= most_openings) { // copies
        return false;
    }
    auto& turns = openings == 0 ? turns_ : repeated_;
    const bool may = has_mac ? turns.take(by.member, now) != member_turns::turn::refused
                             : without_mac_.take(share_of(by.path), now) != address_turns::turn::refused;
    refused_for_ = may ? hello_refusal::none : hello_refusal::busy;
    return may;
}

void half_open_sessions::note_opened(std::uint64_t hello) {
    if (opened_[hello]++ != 0) {
        return;
    }
    opened_order_.push_back(hello);
    if (opened_order_.size() > most_opened) {
        opened_.erase(opened_order_.front());
        opened_order_.pop_front();
    }
}

const hello_datagram* half_open_sessions::receive(const datagram_path& from, const datagram_head& head,
                                                  bytes_view datagram, const std::function<own_part()>& part,
                                                  time_point now) {
    expire(now);
    const auto hello = datagram.first(hello_bytes);
    const auto mac = datagram.subspan(hello_bytes);
    const auto* const self = fleet_.self();
    const auto* const member = fleet_.in_force().find(head.sender);
    refused_for_ = hello_refusal::none;
    if (self == nullptr) {
        return nullptr;
    }
    if (member == nullptr) {
        refused_for_ = hello_refusal::not_member;
        return nullptr;
    }
    if (!mac.empty() && !macs_.verify(*member, hello, mac)) {
        refused_for_ = hello_refusal::unproven;
        return nullptr;
    }
    const auto key = key_of(from, hello);
    if (const auto known = hellos_.find(key); known != hellos_.end()) {
        const auto& same = entries_.at(known->second);
        if (same.session->agreed().peer.path == from && std::ranges::equal(same.hello, hello)) {
            return &same.welcome;
        }
    }
    if (!may_open({.path = from, .member = head.sender}, hello, !mac.empty(), now)) {
        return nullptr;
    }

    noise_responder handshake{{.secret = fleet_.own_key().agreement_secret(),
                               .own = fleet_.own_key().agreement_part(),
                               .peer = member->agreement}};
    const auto prologue = hello_prologue(fleet_.in_force().fleet(), self->number, hello.first<hello_head_bytes>());
    std::array<std::uint8_t, statement_bytes> payload{};
    if (!handshake.read(prologue, hello.subspan(hello_head_bytes), payload)) {
        refused_for_ = hello_refusal::unproven;
        return nullptr;
    }
    note_opened(beginning_of_key(hello));
    const auto own = part();
    agreed_session agreed{.peer = {.path = from, .member = head.sender},
                          .own_index = own.index,
                          .peer_index = head.index,
                          .begun = now,
                          .order = own.order};
    std::uint64_t ignored = 0;
    agreed.stated = read_statement(payload, ignored);

    entry made{.key = key};
    std::ranges::copy(hello, made.hello.begin());
    write_hello_head(datagram_kind::welcome, self->number, head.index, made.welcome.data());
    secret_bytes ephemeral{32};
    random_.fill(ephemeral.span());
    traffic_keys keys;
    if (!handshake.write(write_statement(own.index, own.stated), ephemeral,
                         std::span{made.welcome}.subspan(hello_head_bytes), keys)) {
        return nullptr;
    }
    made.session = std::make_unique<datagram_session>(agreed, std::move(keys));
    if (entries_.size() == most) {
        erase(entries_.begin());
    }
    hellos_[key] = own.order;
    indices_[own.index] = own.order;
    return &entries_.emplace_hint(entries_.end(), own.order, std::move(made))->second.welcome;
}

datagram_session* half_open_sessions::find(std::uint64_t index) noexcept {
    const auto found = indices_.find(index);
    return found == indices_.end() ? nullptr : entries_.find(found->second)->second.session.get();
}

std::unique_ptr<datagram_session> half_open_sessions::take(std::uint64_t index) {
    const auto at = entries_.find(indices_.find(index)->second);
    auto taken = std::move(at->second.session);
    indices_.erase(index);
    if (const auto hello = hellos_.find(at->second.key); hello != hellos_.end() && hello->second == at->first) {
        hellos_.erase(hello);
    }
    entries_.erase(at);
    return taken;
}

half_open_sessions::entries::iterator half_open_sessions::erase(entries::iterator at) {
    const auto next = std::next(at);
    static_cast<void>(take(at->second.session->agreed().own_index));
    return next;
}

std::optional<time_point> half_open_sessions::next_deadline() const noexcept {
    if (entries_.empty()) {
        return {};
    }
    return entries_.begin()->second.session->agreed().begun + longest;
}

void half_open_sessions::expire(time_point now) {
    for (auto at = entries_.begin(); at != entries_.end() && at->second.session->agreed().begun + longest <= now;) {
        at = erase(at);
    }
}

void half_open_sessions::forget(std::uint32_t member) {
    macs_.forget(member);
    for (auto at = entries_.begin(); at != entries_.end();) {
        at = at->second.session->agreed().peer.member == member ? erase(at) : std::next(at);
    }
}

void half_open_sessions::clear() {
    macs_.clear();
    entries_.clear();
    hellos_.clear();
    indices_.clear();
}

} // namespace cles::security
