// SPDX-License-Identifier: BSL-1.0
#include "security/messages/sealed_messages.hpp"

#include "protocol/hex_number.hpp"
#include "security/keys/bytes.hpp"
#include "security/keys/keys.hpp"
#include "security/keys/signed_text.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <span>

#include <sodium.h>

namespace cles::security {
namespace {

// The first byte, as of datagrams (datagram_kind).
enum class message_kind : std::uint8_t { pool = 0x85, ask = 0x86, roster = 0x87 };

constexpr std::string_view pool_label = "cles pool 1\n";
constexpr std::size_t authenticated_from = pool_label.size() + sizeof(public_key); // where in the text that is signed
constexpr std::size_t signature_bytes = sizeof(signature);
constexpr std::size_t message_at = group_head_bytes + signature_bytes;
constexpr std::size_t question_head_bytes = 4; // of ASK and ROSTER
constexpr std::size_t ask_bytes = question_head_bytes + 4;
constexpr std::size_t max_roster_bytes = question_head_bytes + sealed_overhead + max_roster_line;
constexpr std::string_view ask_word = "ask ";
constexpr std::string_view live_word = "live ";
constexpr std::string_view hello_word = "hello ";
constexpr std::string_view welcome_word = "welcome ";
constexpr std::string_view unknown_word = "unknown ";

static_assert(core::message_seal::overhead == message_at + seal_bytes);
static_assert(core::message_seal::overhead >= bridge_sessions::overhead);

std::uint8_t* writable(std::string& text) { return reinterpret_cast<std::uint8_t*>(text.data()); }

void write_question_head(message_kind kind, std::uint32_t sender, std::uint8_t* to) {
    to[0] = static_cast<std::uint8_t>(kind);
    store_big<3>(sender, to + 1);
}

std::uint32_t sender_of(bytes_view bytes) { return static_cast<std::uint32_t>(load_big<3>(bytes.data() + 1)); }

std::uint64_t instance_of(std::uint32_t member, const group_salt& salt) {
    return std::uint64_t{member} << 40U | load_big<5>(salt.data());
}

bool is_of(std::optional<std::uint64_t> instance, std::uint32_t member) {
    return instance && *instance >> 40U == member;
}

// Subjects are separated by LF in what is signed; one with an LF would give it a second reading.
bool is_one_line(std::string_view subject) { return subject.find('\n') == std::string_view::npos; }

core::message_seal::opened_message refused_because(std::string_view why) { return {.why = why}; }

} // namespace

sealed_messages::sealed_messages(fleet& of, entropy& random, roster_sink take_roster, std::uint64_t first_counter)
    : fleet_(of), random_(random), take_roster_(std::move(take_roster)), counter_(first_counter), salts_(of),
      sessions_(of, random) {
    random_.fill(salt_);
    if (const auto* const self = fleet_.self()) {
        salts_.learn(self->number, salt_, 0, first_counter); // NATS delivers what a bridge sends to itself, too
    }
}

std::uint64_t sealed_messages::instance() const {
    const auto* const self = fleet_.self();
    return self == nullptr ? 0 : instance_of(self->number, salt_);
}

// In a child process, the parent goes on with the same salt and counter.
bool sealed_messages::may_send() const { return fleet_.self() != nullptr && process_ == fork_count(); }

// -- sealing -------------------------------------------------------------------------------------------------------

// From `authenticated_from` on, and without what follows the subject for replies, it is the additional data, too.
void sealed_messages::write_text(const std::uint8_t* head, std::string_view subject, std::string_view reply,
                                 std::string_view message) {
    text_.assign(pool_label);
    text_.append(as_text(fleet_.in_force().fleet()));
    text_.append(as_text({head, group_head_bytes}));
    text_.append(subject).append(1, '\n').append(reply).append(1, '\n').append(message);
}

std::string sealed_messages::seal(std::string_view subject, std::string_view reply, std::string_view message) {
    const auto generation = fleet_.ring().current();
    const auto* const key = fleet_.ring().find(generation);
    if (!may_send() || key == nullptr || counter_ == std::numeric_limits<std::uint64_t>::max() ||
        !is_one_line(subject) || !is_one_line(reply)) {
        return {};
    }
    std::string sealed(overhead + message.size(), '\0');
    auto* const to = writable(sealed);
    write_group_head(fleet_.self()->number, generation, salt_, counter_++, to);
    to[0] = static_cast<std::uint8_t>(message_kind::pool);
    write_text(to, subject, reply, message);
    std::ranges::copy(fleet_.own_key().sign(text_), to + group_head_bytes);
    std::ranges::copy(as_bytes(message), to + message_at);
    const auto additional =
        as_bytes(text_).subspan(authenticated_from, group_head_bytes + subject.size() + 1 + reply.size());
    crypto_aead_xchacha20poly1305_ietf_encrypt(to + group_head_bytes, nullptr, to + group_head_bytes,
                                               signature_bytes + message.size(), additional.data(), additional.size(),
                                               nullptr, to + group_nonce_at, key->data());
    return sealed;
}

sealed_messages::sealed_message sealed_messages::seal_for(std::uint64_t to, std::string_view subject,
                                                          std::string_view reply, std::string_view message,
                                                          time_point now) {
    const auto own = instance();
    if (to == own || !sessions_.is_able(to)) {
        return {.bytes = seal(subject, reply, message)};
    }
    if (!may_send() || !is_one_line(subject) || !is_one_line(reply)) {
        return {};
    }
    send_hello(to, sessions_.hello_if_due(own, to, now));
    auto sealed = sessions_.seal(own, to, subject, reply, message, now);
    const bool waits = sealed.empty();
    return {.bytes = std::move(sealed), .in_session = !waits, .waits = waits};
}

// -- opening -------------------------------------------------------------------------------------------------------

sealed_messages::opened_message sealed_messages::unseal(std::string_view subject, std::string_view reply,
                                                        const origin& from, std::string_view bytes, time_point now) {
    const auto sealed = as_bytes(bytes);
    if (sealed.size() < overhead || sealed[0] != static_cast<std::uint8_t>(message_kind::pool)) {
        return refused_because("it is not sealed");
    }
    if (fleet_.self() == nullptr) {
        return refused_because("this node is not in the roster");
    }
    const auto head = read_group_head(sealed.data());
    if (from.instance && *from.instance != instance_of(head.sender, head.salt)) {
        return refused_because("it is not of the bridge that its subjects state");
    }
    const auto* const sender = fleet_.in_force().find(head.sender);
    if (sender == nullptr) {
        if (head.sender > fleet_.in_force().last()) { // numbers are not given again: a newer roster has it
            ask_for_roster(from, for_unopened_, now);
        }
        return refused_because("its sender is not in the roster");
    }
    if (fleet_.ring().is_future(head.generation)) {
        ask_for_roster(from, for_unopened_, now);
        return refused_because("it is sealed with the group key of a newer roster");
    }
    const auto* const key = fleet_.ring().find(head.generation);
    if (key == nullptr) {
        return refused_because("it is sealed with a group key that is not accepted any more");
    }
    auto* const known = salts_.find(head.sender, head.salt);
    auto* const window = known == nullptr ? nullptr : from.is_update ? &known->updates : &known->window;
    if (window != nullptr && !window->accepts(head.counter)) {
        return refused_because("it is repeated or too late");
    }
    if (!is_one_line(subject) || !is_one_line(reply)) {
        return refused_because("its subject contains a line end");
    }
    write_text(sealed.data(), subject, reply, {});
    const auto additional = as_bytes(text_).subspan(authenticated_from, text_.size() - authenticated_from - 1);
    opened_.resize(sealed.size() - group_head_bytes - seal_bytes);
    if (crypto_aead_xchacha20poly1305_ietf_decrypt(
            opened_.data(), nullptr, nullptr, sealed.data() + group_head_bytes, sealed.size() - group_head_bytes,
            additional.data(), additional.size(), sealed.data() + group_nonce_at, key->data()) != 0) {
        return refused_because("it was altered, or is of another subject or fleet");
    }
    signature made{};
    std::copy_n(opened_.begin(), made.size(), made.begin());
    const auto message = as_text(bytes_view{opened_}.subspan(signature_bytes));
    text_.append(message);
    if (!verify(sender->key, text_, made)) {
        return refused_because("its signature is not that of its sender");
    }
    if (window != nullptr) {
        window->note(head.counter);
    }
    return {.what = known == nullptr ? verdict::unproven : verdict::opened,
            .sender = sender->name,
            .instance = instance_of(head.sender, head.salt),
            .message = message};
}

sealed_messages::opened_message sealed_messages::open(std::string_view subject, std::string_view reply,
                                                      const origin& from, std::string_view bytes, time_point now) {
    if (!bytes.empty() && as_bytes(bytes)[0] == bridge_sessions::message_kind) {
        return open_in_session(subject, reply, from, as_bytes(bytes), now);
    }
    const auto opened = unseal(subject, reply, from, bytes, now);
    if (from.is_for_one && opened.what != verdict::refused && opened.instance != instance() &&
        sessions_.is_able(opened.instance)) { // nobody can make two bridges do without their sessions
        return refused_because("it is signed, and its sender has sessions");
    }
    if (opened.what != verdict::unproven) {
        return opened;
    }
    const auto head = read_group_head(as_bytes(bytes).data());
    const salt_of_member about{head.sender, head.salt};
    ask_whether_alive(from, about, now);
    // The caller may tell the sender that the message has no effect, so it must have none when it arrives again.
    const auto note = [&head](challenge& asked) { asked.highest = std::max(asked.highest, head.counter); };
    return challenges_.change_open(about, now, note) ? opened : refused_because("its sender may not be alive any more");
}

sealed_messages::opened_message sealed_messages::open_in_session(std::string_view subject, std::string_view reply,
                                                                 const origin& from, bytes_view sealed,
                                                                 time_point now) {
    const auto head = bridge_sessions::read_head(sealed);
    if (!head || !from.is_for_one) {
        return refused_because("it is not sealed");
    }
    if (fleet_.self() == nullptr) {
        return refused_because("this node is not in the roster");
    }
    if (from.instance && *from.instance != head->instance) {
        return refused_because("it is not of the bridge that its subjects state");
    }
    const auto* const sender = fleet_.in_force().find(static_cast<std::uint32_t>(head->instance >> 40U));
    if (sender == nullptr) {
        return refused_because("its sender is not in the roster");
    }
    if (!is_one_line(subject) || !is_one_line(reply)) {
        return refused_because("its subject contains a line end");
    }
    switch (sessions_.open(*head, subject, reply, sealed, opened_, now)) {
    case bridge_sessions::verdict::opened: break;
    case bridge_sessions::verdict::refused:
        return refused_because("it was altered or repeated, or is too late, or of another subject");
    case bridge_sessions::verdict::unknown:
        tell_unknown_session(*head, now);
        return refused_because("it is sealed under a session that is not known here");
    }
    return {.what = verdict::opened, .sender = sender->name, .instance = head->instance, .message = as_text(opened_)};
}

void sealed_messages::forget(std::uint64_t instance) {
    std::array<std::uint8_t, 8> bytes{};
    store_big<8>(instance, bytes.data());
    const auto member = static_cast<std::uint32_t>(instance >> 40U);
    salts_.forget(member, std::span{bytes}.subspan(3));
    sessions_.end_sessions(instance);
    challenges_.end_if([&](const salt_of_member& about) {
        return about.first == member && instance_of(member, about.second) == instance;
    });
}

// -- questions -----------------------------------------------------------------------------------------------------

void sealed_messages::keep(std::string_view subject, decltype(pending::what) what) {
    if (pending_.size() == max_questions) {
        pending_.pop_front();
    }
    pending_.push_back({.subject = std::string{subject}, .what = std::move(what)});
}

void sealed_messages::ask_whether_alive(const origin& who, const salt_of_member& about, time_point now) {
    if (who.questions.empty() || !challenges_.take_turn(about, now)) {
        return;
    }
    std::array<std::uint8_t, 16> drawn{};
    random_.fill(drawn);
    auto text = to_base64url(drawn);
    keep(who.questions, own_text{std::string{ask_word}.append(text)});
    challenges_.note(about, {.text = std::move(text)}, now);
}

void sealed_messages::ask_for_roster(const origin& who, roster_questions& reason, time_point now) {
    if (who.instance && !who.questions.empty() && reason.take_turn(*who.instance, now)) {
        keep(who.questions, roster_wanted{});
        reason.note(*who.instance, {}, now);
    }
}

void sealed_messages::on_stated_roster(const origin& by, std::uint32_t version, time_point now) {
    if (version > fleet_.in_force().version()) {
        ask_for_roster(by, for_stated_, now);
    }
}

void sealed_messages::on_stated_sessions(const origin& by, time_point now) {
    if (by.instance && !by.questions.empty() && *by.instance != instance()) {
        sessions_.note_able(*by.instance, by.questions, now);
        send_hello(*by.instance, sessions_.hello_if_due(instance(), *by.instance, now));
    }
}

void sealed_messages::send_hello(std::uint64_t to, std::string text) {
    if (!text.empty()) {
        keep(sessions_.questions_of(to), own_text{std::string{hello_word}.append(text)});
    }
}

void sealed_messages::begin_session_again(std::uint64_t with, time_point now) {
    send_hello(with, sessions_.begin_again(instance(), with, now));
}

// Anybody can send a message that causes this, so it is signed, and concerns that session only.
void sealed_messages::tell_unknown_session(const session_head& head, time_point now) {
    if (sessions_.is_able(head.instance) && unknown_sessions_.take_turn(head.instance, now)) {
        keep(sessions_.questions_of(head.instance),
             own_text{std::string{unknown_word}.append(protocol::hex_text(head.index))});
        unknown_sessions_.note(head.instance, {}, now);
    }
}

// Of a bridge that is proved to be alive.
void sealed_messages::on_session_question(const origin& from, std::uint64_t sender, std::string_view words,
                                          time_point now) {
    if (from.questions.empty() || sender == instance()) {
        return;
    }
    if (words.starts_with(hello_word)) {
        sessions_.note_able(sender, from.questions, now);
        if (auto answer = sessions_.take_hello(instance(), sender, words.substr(hello_word.size()), now);
            !answer.empty()) {
            keep(from.questions, own_text{std::string{welcome_word}.append(answer)});
        }
    } else if (words.starts_with(welcome_word)) {
        sessions_.take_welcome(sender, words.substr(welcome_word.size()));
    } else if (words.starts_with(unknown_word)) {
        if (const auto index = protocol::parse_hex<std::uint64_t>(words.substr(unknown_word.size()))) {
            sessions_.end_unknown(sender, *index);
            send_hello(sender, sessions_.hello_if_due(instance(), sender, now));
        }
    }
}

std::vector<core::message_seal::question> sealed_messages::take_questions(std::string_view questions) {
    std::vector<question> taken;
    for (auto& each : std::exchange(pending_, {})) {
        if (auto message = write(each, questions); !message.empty()) {
            taken.push_back({.subject = std::move(each.subject), .message = std::move(message)});
        }
    }
    return taken;
}

// Empty if this node, or who is to get a roster, has left the fleet.
std::string sealed_messages::write(const pending& what, std::string_view questions) {
    if (!may_send()) {
        return {};
    }
    if (const auto* const text = std::get_if<own_text>(&what.what)) {
        return seal(what.subject, questions, text->text);
    }
    const auto& in_force = fleet_.in_force();
    if (const auto* const to = std::get_if<roster_for>(&what.what)) {
        const auto* const member = in_force.find(to->member);
        if (member == nullptr) {
            return {};
        }
        const auto box = seal_box(member->agreement, as_bytes(in_force.line()));
        std::string message(question_head_bytes, '\0');
        write_question_head(message_kind::roster, fleet_.self()->number, writable(message));
        return message.append(as_text(box));
    }
    std::string message(ask_bytes, '\0');
    write_question_head(message_kind::ask, fleet_.self()->number, writable(message));
    store_big<4>(in_force.version(), writable(message) + question_head_bytes);
    return message;
}

bool sealed_messages::on_question(std::string_view subject, const origin& from, std::string_view bytes,
                                  time_point now) {
    if (bytes.empty()) {
        return false;
    }
    switch (static_cast<message_kind>(as_bytes(bytes)[0])) {
    case message_kind::pool: return on_sealed_question(subject, from, bytes, now);
    case message_kind::ask: on_ask(from, as_bytes(bytes), now); return false;
    case message_kind::roster: on_roster(from, as_bytes(bytes), now); return false;
    default: return false;
    }
}

bool sealed_messages::on_sealed_question(std::string_view subject, const origin& from, std::string_view bytes,
                                         time_point now) {
    const auto opened = unseal(subject, from.questions, from, bytes, now);
    if (opened.what == verdict::refused) {
        return false;
    }
    const auto words = opened.message;
    const auto head = read_group_head(as_bytes(bytes).data());
    const salt_of_member about{head.sender, head.salt};
    if (opened.what == verdict::unproven && words.starts_with(live_word)) {
        const auto is_this = [text = words.substr(live_word.size())](const challenge& c) { return c.text == text; };
        if (const auto answered = challenges_.take(about, now, is_this)) {
            salts_.learn(head.sender, head.salt, 0, std::max(head.counter, answered->highest) + 1);
            begin_session_again(opened.instance, now); // WELCOME may have come before, and then did not count
            return true;
        }
    }
    // Who is not known yet is answered, too: an old question that is repeated only gets a proof that this end is alive.
    const bool is_asked =
        words.starts_with(ask_word) && is_challenge(words.substr(ask_word.size())) && !from.questions.empty();
    if (is_asked && proofs_.take(now)) {
        keep(from.questions, own_text{std::string{live_word}.append(words.substr(ask_word.size()))});
        if (opened.what == verdict::opened) { // it does not know this bridge any more, so it has no session of it
            begin_session_again(opened.instance, now); // after the proof, without which HELLO has no effect
        }
    }
    if (opened.what == verdict::unproven) {
        ask_whether_alive(from, about, now);
    } else {
        on_session_question(from, opened.instance, words, now);
    }
    return is_asked;
}

void sealed_messages::on_ask(const origin& from, bytes_view bytes, time_point now) {
    if (bytes.size() != ask_bytes || from.questions.empty()) {
        return;
    }
    const auto number = sender_of(bytes);
    const auto& in_force = fleet_.in_force();
    if (is_of(from.instance, number) && load_big<4>(bytes.data() + question_head_bytes) < in_force.version() &&
        in_force.find(number) != nullptr && roster_answers_.take_turn(number, now)) {
        keep(from.questions, roster_for{number});
        roster_answers_.note(number, {}, now);
    }
}

void sealed_messages::on_roster(const origin& from, bytes_view bytes, time_point now) {
    if (bytes.size() <= question_head_bytes || bytes.size() > max_roster_bytes ||
        !is_of(from.instance, sender_of(bytes))) {
        return;
    }
    const auto was_asked = for_stated_.is_open(*from.instance, now) || for_unopened_.is_open(*from.instance, now);
    if (!was_asked || !boxes_.take(now)) {
        return;
    }
    // Anybody can send such a message, so only a roster that counts ends the question.
    const auto version = fleet_.in_force().version();
    if (const auto line = fleet_.own_key().open_box(bytes.subspan(question_head_bytes)); line.size() != 0) {
        take_roster_(as_text(line.view()));
    }
    if (fleet_.in_force().version() != version) {
        for_stated_.end(*from.instance);
        for_unopened_.end(*from.instance);
    }
}

} // namespace cles::security
