// SPDX-License-Identifier: BSL-1.0
#include "security/messages/bridge_sessions.hpp"

#include "security/datagrams/datagram_format.hpp"
#include "security/keys/bytes.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <limits>
#include <span>
#include <utility>

namespace cles::security {
namespace {

constexpr std::string_view prologue_label = "cles pool session 1\n";
constexpr std::size_t index_bytes = 8;
constexpr std::size_t prologue_bytes = prologue_label.size() + sizeof(public_key) + 3 * index_bytes;
constexpr std::size_t hello_text_bytes = index_bytes + noise_overhead;
constexpr std::size_t welcome_text_bytes = index_bytes + noise_overhead + index_bytes;

static_assert(bridge_sessions::head_bytes == 1 + 3 * index_bytes);
static_assert(bridge_sessions::overhead == bridge_sessions::head_bytes + seal_bytes);

constexpr std::uint32_t member_of(std::uint64_t instance) { return static_cast<std::uint32_t>(instance >> 40U); }
constexpr std::uint64_t first_of(std::uint32_t member) { return std::uint64_t{member} << 40U; }
constexpr std::uint64_t last_of(std::uint32_t member) { return first_of(member) | 0xFF'FFFF'FFFFU; }

// What a handshake is about: it counts for one fleet, one bridge at each end, and one HELLO.
std::array<std::uint8_t, prologue_bytes> prologue_of(const public_key& fleet, std::uint64_t initiator,
                                                     std::uint64_t responder, std::uint64_t index) {
    std::array<std::uint8_t, prologue_bytes> to{};
    auto* at = std::ranges::copy(prologue_label, to.data()).out;
    at = std::ranges::copy(fleet, at).out;
    store_big<8>(initiator, at);
    store_big<8>(responder, at + index_bytes);
    store_big<8>(index, at + 2 * index_bytes);
    return to;
}

noise_keys keys_with(const fleet& of, const member& peer) {
    return {.secret = of.own_key().agreement_secret(), .own = of.own_key().agreement_part(), .peer = peer.agreement};
}

} // namespace

bridge_sessions::bridge_sessions(fleet& of, entropy& random)
    : fleet_(of), random_(random), observation_(of.observe([this](const roster& before) { on_roster(before); })) {}

// -- other bridges -------------------------------------------------------------------------------------------------

bridge_sessions::peer_state* bridge_sessions::find(std::uint64_t peer) {
    const auto found = peers_.find(peer);
    return found == peers_.end() ? nullptr : &found->second;
}

void bridge_sessions::note_able(std::uint64_t peer, std::string_view questions, time_point now) {
    auto* known = find(peer);
    if (known == nullptr) {
        make_space(member_of(peer));
        known = &peers_[peer];
    }
    known->order = ++order_;
    known->questions = questions;
    std::erase_if(known->receiving, [now](const receiving_session& s) { return now - s.begun >= forget_after; });
    if (known->sending && now - known->sending->begun >= forget_after) {
        known->sending.reset();
    }
}

std::string_view bridge_sessions::questions_of(std::uint64_t peer) const {
    const auto found = peers_.find(peer);
    return found == peers_.end() ? std::string_view{} : found->second.questions;
}

// That the bridge has sessions stays known: otherwise messages for it would be signed, which it refuses.
void bridge_sessions::end_sessions(std::uint64_t peer) {
    if (auto* const known = find(peer)) {
        *known = peer_state{.questions = std::move(known->questions), .order = known->order};
    }
}

// A member can connect as often as it likes: the bridge is forgotten that has been silent for longest.
void bridge_sessions::make_space(std::uint32_t member) {
    const auto first = peers_.lower_bound(first_of(member));
    const auto last = peers_.upper_bound(last_of(member));
    if (static_cast<std::size_t>(std::distance(first, last)) >= most_of_member) {
        peers_.erase(std::min_element(
            first, last, [](const auto& one, const auto& other) { return one.second.order < other.second.order; }));
    }
}

void bridge_sessions::erase_all_of(std::uint32_t member) {
    peers_.erase(peers_.lower_bound(first_of(member)), peers_.upper_bound(last_of(member)));
}

void bridge_sessions::on_roster(const roster& before) {
    if (!fleet_.is_same_since(before)) {
        peers_.clear();
        return;
    }
    for (const auto& member : before.members()) {
        if (!fleet_.in_force().has(member)) {
            erase_all_of(member.number);
        }
    }
}

// -- handshakes ----------------------------------------------------------------------------------------------------

std::string bridge_sessions::hello_if_due(std::uint64_t own, std::uint64_t peer, time_point now) {
    auto* const p = find(peer);
    if (p == nullptr || (p->hello_sent && now - *p->hello_sent < between_hellos)) {
        return {};
    }
    if (p->sending && now - p->sending->begun < rekey_after && p->sending->next < rekey_messages) {
        return {};
    }
    if (p->trying == nullptr || now - p->trying->begun >= answered_within) {
        p->trying = begin(own, peer, now);
    }
    p->hello_sent = now;
    return p->trying == nullptr ? std::string{} : p->trying->hello;
}

std::string bridge_sessions::begin_again(std::uint64_t own, std::uint64_t peer, time_point now) {
    if (auto* const p = find(peer)) {
        p->sending.reset();
        p->hello_sent.reset();
    }
    return hello_if_due(own, peer, now);
}

void bridge_sessions::end_unknown(std::uint64_t peer, std::uint64_t index) {
    if (auto* const p = find(peer); p != nullptr && p->sending && p->sending->index == index) {
        p->sending.reset();
    }
}

std::unique_ptr<bridge_sessions::attempt> bridge_sessions::begin(std::uint64_t own, std::uint64_t peer,
                                                                 time_point now) {
    const auto* const with = fleet_.in_force().find(member_of(peer));
    if (with == nullptr) {
        return {};
    }
    const auto index = random_.draw<std::uint64_t>();
    secret_bytes ephemeral{32};
    random_.fill(ephemeral.span());
    noise_initiator handshake{keys_with(fleet_, *with), std::move(ephemeral)};
    std::array<std::uint8_t, hello_text_bytes> hello{};
    store_big<8>(index, hello.data());
    if (!handshake.write(prologue_of(fleet_.in_force().fleet(), own, peer, index), {},
                         std::span{hello}.subspan(index_bytes))) {
        return {};
    }
    return std::make_unique<attempt>(
        attempt{.handshake = std::move(handshake), .index = index, .hello = to_base64url(hello), .begun = now});
}

std::string bridge_sessions::take_hello(std::uint64_t own, std::uint64_t peer, std::string_view hello, time_point now) {
    auto* const p = find(peer);
    const auto* const with = fleet_.in_force().find(member_of(peer));
    std::array<std::uint8_t, hello_text_bytes> bytes{};
    if (p == nullptr || with == nullptr || !read_base64url(hello, bytes) ||
        turns_.take(with->number, now) == member_turns::turn::refused) {
        return {};
    }
    if (const auto known = std::ranges::find(p->receiving, hello, &receiving_session::hello);
        known != p->receiving.end()) {
        return known->welcome; // the first answer was lost
    }
    const auto index = load_big<8>(bytes.data());
    noise_responder handshake{keys_with(fleet_, *with)};
    if (!handshake.read(prologue_of(fleet_.in_force().fleet(), peer, own, index),
                        bytes_view{bytes}.subspan(index_bytes), {})) {
        return {};
    }
    receiving_session made{.index = random_.draw<std::uint64_t>(), .begun = now, .hello = std::string{hello}};
    secret_bytes ephemeral{32};
    random_.fill(ephemeral.span());
    std::array<std::uint8_t, index_bytes> stated{};
    store_big<8>(made.index, stated.data());
    std::array<std::uint8_t, welcome_text_bytes> welcome{};
    store_big<8>(index, welcome.data());
    if (!handshake.write(stated, ephemeral, std::span{welcome}.subspan(index_bytes), made.keys)) {
        return {};
    }
    made.welcome = to_base64url(welcome);
    if (p->receiving.size() == most_received) {
        p->receiving.pop_back();
    }
    return p->receiving.insert(p->receiving.begin(), std::move(made))->welcome;
}

void bridge_sessions::take_welcome(std::uint64_t peer, std::string_view welcome) {
    auto* const p = find(peer);
    std::array<std::uint8_t, welcome_text_bytes> bytes{};
    if (p == nullptr || p->trying == nullptr || !read_base64url(welcome, bytes) ||
        load_big<8>(bytes.data()) != p->trying->index) {
        return;
    }
    sending_session made{.begun = p->trying->begun};
    std::array<std::uint8_t, index_bytes> stated{};
    if (p->trying->handshake.read(bytes_view{bytes}.subspan(index_bytes), stated, made.keys)) {
        made.index = load_big<8>(stated.data());
        p->sending = std::move(made);
        p->trying.reset();
    }
}

// -- messages ------------------------------------------------------------------------------------------------------

bytes_view bridge_sessions::additional_data(bytes_view head, std::string_view subject, std::string_view reply) {
    additional_.assign(as_text(head));
    additional_.append(subject).append(1, '\n').append(reply);
    return as_bytes(additional_);
}

std::string bridge_sessions::seal(std::uint64_t own, std::uint64_t peer, std::string_view subject,
                                  std::string_view reply, std::string_view message, time_point now) {
    auto* const p = find(peer);
    if (p == nullptr || !p->sending || now - p->sending->begun >= forget_after ||
        p->sending->next == std::numeric_limits<std::uint64_t>::max()) {
        return {};
    }
    auto& session = *p->sending;
    const auto counter = session.next++;
    std::string sealed(overhead + message.size(), '\0');
    auto* const to = reinterpret_cast<std::uint8_t*>(sealed.data());
    to[0] = message_kind;
    store_big<8>(own, to + 1);
    store_big<8>(session.index, to + 1 + index_bytes);
    store_big<8>(counter, to + 1 + 2 * index_bytes);
    noise_seal(session.keys.of_initiator(), counter, additional_data({to, head_bytes}, subject, reply),
               as_bytes(message), to + head_bytes);
    return sealed;
}

std::optional<session_head> bridge_sessions::read_head(bytes_view sealed) noexcept {
    if (sealed.size() < overhead || sealed[0] != message_kind) {
        return {};
    }
    return session_head{.instance = load_big<8>(sealed.data() + 1),
                        .index = load_big<8>(sealed.data() + 1 + index_bytes),
                        .counter = load_big<8>(sealed.data() + 1 + 2 * index_bytes)};
}

bridge_sessions::verdict bridge_sessions::open(const session_head& head, std::string_view subject,
                                               std::string_view reply, bytes_view sealed, std::vector<std::uint8_t>& to,
                                               time_point now) {
    auto* const p = find(head.instance);
    if (p == nullptr) {
        return verdict::unknown;
    }
    const auto session = std::ranges::find(p->receiving, head.index, &receiving_session::index);
    if (session == p->receiving.end() || now - session->begun >= forget_after) {
        return verdict::unknown;
    }
    to.resize(sealed.size() - overhead);
    if (!session->window.accepts(head.counter) ||
        !noise_open(session->keys.of_initiator(), head.counter,
                    additional_data(sealed.first(head_bytes), subject, reply), sealed.subspan(head_bytes), to.data())) {
        return verdict::refused;
    }
    session->window.note(head.counter);
    return verdict::opened;
}

} // namespace cles::security
