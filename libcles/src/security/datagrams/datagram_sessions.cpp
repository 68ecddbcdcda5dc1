// SPDX-License-Identifier: BSL-1.0
#include "security/datagrams/datagram_sessions.hpp"

#include <algorithm>
#include <span>

namespace cles::security {
namespace {

using introduction = datagram_peer::introduction;

} // namespace

datagram_sessions::datagram_sessions(fleet& of, datagram_sink& sink, entropy& random, datagram_limits limits)
    : fleet_(of), sink_(sink), random_(random), limits_(limits),
      observation_(of.observe([this](const roster& before) { on_roster(before); })),
      welcomes_(member_bounds(limits.hellos_per_second, half_open_sessions::share_of_member)),
      half_open_(of, random, limits.hellos_per_second) {}

datagram_sessions::~datagram_sessions() = default;

// -- receiving -----------------------------------------------------------------------------------------------------

void datagram_sessions::receive(const datagram_path& from, bytes_view datagram, time_point now) {
    if (process_.forked()) {
        clear();
    }
    const auto head = read_head(datagram);
    if (!head || fleet_.self() == nullptr) {
        return;
    }
    switch (head->kind) {
    case datagram_kind::data: return receive_data(from, *head, datagram, now);
    case datagram_kind::hello: return receive_hello(from, *head, datagram, now);
    case datagram_kind::welcome: return receive_welcome(from, *head, datagram, now);
    case datagram_kind::group: return;
    }
}

void datagram_sessions::receive_hello(const datagram_path& from, const datagram_head& head, bytes_view datagram,
                                      time_point now) {
    const auto part = [this] {
        return half_open_sessions::own_part{.index = new_index(), .order = ++order_, .stated = sink_.statement()};
    };
    if (const auto* const welcome = half_open_.receive(from, head, datagram, part, now)) {
        sink_.send(from, *welcome);
    } else if (half_open_.refused_for() != hello_refusal::none) {
        sink_.refused({.path = from, .member = head.sender}, half_open_.refused_for());
    }
}

void datagram_sessions::receive_welcome(const datagram_path& from, const datagram_head& head, bytes_view datagram,
                                        time_point now) {
    const auto found = attempts_.find(head.index);
    if (found == attempts_.end()) {
        return;
    }
    auto& p = *found->second;
    std::array<std::uint8_t, statement_bytes> payload{};
    traffic_keys keys;
    if (p.source() != datagram_source{.path = from, .member = head.sender} ||
        welcomes_.take(head.sender, now) == member_turns::turn::refused ||
        !p.trying->handshake.read(datagram.subspan(hello_head_bytes), payload, keys)) {
        return;
    }
    agreed_session agreed{.peer = p.source(),
                          .initiator = true,
                          .own_index = head.index,
                          .begun = p.trying->begun,
                          .order = p.trying->order};
    agreed.stated = read_statement(payload, agreed.peer_index);
    end_attempt(p);
    // It is the newest: sessions that began later would have ended the attempt.
    const auto introduced = p.introduce(std::make_unique<datagram_session>(agreed, std::move(keys)));
    p.received = now;
    p.retry.start(now);
    if (introduced == introduction::restarted) {
        drop_waiting(p);
    }
    if (!send_waiting(p, now)) {
        send_in(p, *p.newest(), {}, now); // so that the peer may use the session
    }
    arm(p);
    sink_.established(agreed.peer, agreed.stated, introduced == introduction::restarted);
}

void datagram_sessions::receive_data(const datagram_path& from, const datagram_head& head, bytes_view datagram,
                                     time_point now) {
    const datagram_source source{.path = from, .member = head.sender};
    const auto used = sessions_.find(head.index);
    const bool in_use = used != sessions_.end();
    auto* const session = in_use ? used->second.session : half_open_.find(head.index);
    if (session == nullptr || session->agreed().peer != source ||
        now - session->agreed().begun >= (in_use ? limits_.forget_after : half_open_sessions::longest)) {
        return;
    }
    const bool first = !session->confirmed();
    const auto length = session->open(head, datagram, opened_);
    if (!length) {
        return;
    }
    auto introduced = introduction::refused;
    auto* const p = in_use ? used->second.peer : find_or_make(source, now);
    if (first) {
        if (!in_use) {
            auto taken = half_open_.take(head.index);
            introduced = p == nullptr ? introduction::refused : p->introduce(std::move(taken));
            if (introduced == introduction::refused) {
                return;
            }
            end_attempt(*p); // it would result in the same
            if (introduced == introduction::restarted) {
                drop_waiting(*p);
            }
        }
        if (p->unconfirmed() == nullptr && p->trying == nullptr) {
            p->retry.stop();
        }
        p->drop_surplus();
        arm(*p);
        if (!sessions_.contains(head.index)) { // there are two newer ones
            return;
        }
        send_waiting(*p, now);
    }
    p->received = p->last_used = now;
    rekey_if_old(*p, *session, now);
    const auto agreed = session->agreed(); // copied: the sink may end the session
    if (*length == 0 && !agreed.initiator) {
        send_in(*p, *session, {}, now);
    }
    if (introduced != introduction::refused) {
        sink_.established(source, agreed.stated, introduced == introduction::restarted);
        if (!sessions_.contains(head.index)) {
            return;
        }
    }
    if (*length != 0) {
        sink_.opened(source, agreed.stated.epoch, as_text({opened_.data(), *length}));
    }
}

// -- sending -------------------------------------------------------------------------------------------------------

bool datagram_sessions::send(const datagram_source& to, std::string_view line, time_point now) {
    if (process_.forked()) {
        clear();
    }
    if (line.size() > max_line || fleet_.self() == nullptr) {
        return false;
    }
    auto* p = recent_ != nullptr && recent_->source() == to ? recent_ : find(to);
    if (p != nullptr) {
        recent_ = p;
        p->drop_begun_until(now - limits_.forget_after);
        if (auto* const session = p->newest()) {
            send_in(*p, *session, line, now);
            rekey_if_old(*p, *session, now);
            return true;
        }
    } else if (fleet_.in_force().find(to.member) != nullptr) {
        p = find_or_make(to, now);
    }
    return p != nullptr && begin(*p, now) && keep_waiting(*p, line);
}

void datagram_sessions::send_in(peer& p, datagram_session& session, std::string_view line, time_point now) {
    p.last_used = now;
    sink_.send(p.source().path, session.seal(fleet_.self()->number, as_bytes(line), sealed_));
}

bool datagram_sessions::send_waiting(peer& p, time_point now) {
    const auto lines = std::exchange(p.waiting, {});
    drop_waiting(p);
    for (const auto& line : lines) {
        send_in(p, *p.newest(), line, now);
    }
    return !lines.empty();
}

bool datagram_sessions::keep_waiting(peer& p, std::string_view line) {
    if (p.waiting.size() == limits_.waiting_lines || p.waiting_bytes + line.size() > limits_.waiting_bytes ||
        waiting_bytes_ + line.size() > limits_.waiting_bytes_in_all) {
        return false;
    }
    p.waiting.emplace_back(line);
    p.waiting_bytes += line.size();
    waiting_bytes_ += line.size();
    return true;
}

void datagram_sessions::drop_waiting(peer& p) {
    waiting_bytes_ -= std::exchange(p.waiting_bytes, 0);
    p.waiting.clear();
}

// -- handshakes that this node begins ------------------------------------------------------------------------------

bool datagram_sessions::contact(const datagram_source& with, time_point now) {
    if (process_.forked()) {
        clear();
    }
    if (fleet_.self() == nullptr || fleet_.in_force().find(with.member) == nullptr) {
        return false;
    }
    auto* const p = find_or_make(with, now);
    return p != nullptr && begin(*p, now);
}

void datagram_sessions::check_peer(const datagram_source& with, time_point since, time_point now) {
    const auto* const p = find(with);
    if (p == nullptr || p->newest() == nullptr || p->received <= since) {
        contact(with, now);
    }
}

void datagram_sessions::rekey_if_old(peer& p, const datagram_session& session, time_point now) {
    if (session.agreed().initiator && &session == p.newest() &&
        (now - session.agreed().begun >= limits_.rekey_after || session.used() >= limits_.rekey_datagrams)) {
        begin(p, now);
    }
}

bool datagram_sessions::begin(peer& p, time_point now) {
    if (p.trying != nullptr || p.unconfirmed() != nullptr) {
        return true;
    }
    const auto& roster = fleet_.in_force();
    const auto& member = *roster.find(p.source().member); // else the peer would be forgotten
    secret_bytes ephemeral{32};
    random_.fill(ephemeral.span());
    noise_initiator handshake{{.secret = fleet_.own_key().agreement_secret(),
                               .own = fleet_.own_key().agreement_part(),
                               .peer = member.agreement},
                              std::move(ephemeral)};
    const auto index = new_index();
    std::array<std::uint8_t, hello_with_mac_bytes> hello{};
    write_hello_head(datagram_kind::hello, fleet_.self()->number, index, hello.data());
    const auto text = std::span{hello}.first<hello_bytes>();
    if (!handshake.write(hello_prologue(roster.fleet(), member.number, text.first<hello_head_bytes>()),
                         write_statement(0, sink_.statement()), text.subspan(hello_head_bytes))) {
        return false;
    }
    std::ranges::copy(half_open_.macs().make(member, text), hello.begin() + hello_bytes);
    p.trying = std::make_unique<hello_attempt>(hello_attempt{
        .handshake = std::move(handshake), .hello = hello, .index = index, .order = ++order_, .begun = now});
    attempts_[index] = &p;
    p.retry.start(now);
    p.last_used = now;
    arm(p);
    sink_.send(p.source().path, hello);
    return true;
}

// Nodes of earlier versions ignore HELLO with a MAC. Others open few without one, so that alone is not enough.
void datagram_sessions::send_again(const peer& p) {
    const bytes_view hello = p.trying->hello;
    sink_.send(p.source().path, hello);
    sink_.send(p.source().path, hello.first(hello_bytes));
}

void datagram_sessions::end_attempt(peer& p) {
    if (p.trying != nullptr) {
        attempts_.erase(p.trying->index);
        p.trying = nullptr;
        p.retry.stop();
    }
}

std::uint64_t datagram_sessions::new_index() {
    for (;;) {
        const auto index = random_.draw<std::uint64_t>();
        if (!sessions_.contains(index) && !attempts_.contains(index) && half_open_.find(index) == nullptr) {
            return index;
        }
    }
}

// -- peers ---------------------------------------------------------------------------------------------------------

datagram_peer* datagram_sessions::find(const datagram_source& source) {
    const auto found = peers_.find(source);
    return found == peers_.end() ? nullptr : found->second.get();
}

datagram_peer* datagram_sessions::find_or_make(const datagram_source& source, time_point now) {
    if (auto* const known = find(source)) {
        return known;
    }
    if (!make_space(source.member)) {
        return nullptr;
    }
    auto made = std::make_unique<peer>(source, ++order_, sessions_);
    auto* const p = made.get();
    p->last_used = now;
    members_[source.member].push_back(p);
    peers_.emplace(source, std::move(made));
    return p;
}

// A member can use any number of addresses and ports: the one that was not used for the longest time is forgotten.
bool datagram_sessions::make_space(std::uint32_t member) {
    const auto found = members_.find(member);
    if (found == members_.end() || found->second.size() < limits_.sources_per_member) {
        return true;
    }
    peer* oldest = nullptr;
    for (auto* const p : found->second) {
        if (p->trying == nullptr && (oldest == nullptr || p->last_used < oldest->last_used)) {
            oldest = p;
        }
    }
    if (oldest == nullptr) {
        return false;
    }
    erase(*oldest);
    return true;
}

void datagram_sessions::release(const datagram_source& which) {
    if (auto* const p = find(which); p != nullptr && p->is_idle()) {
        erase(*p);
    }
}

void datagram_sessions::erase(peer& p) {
    end_attempt(p);
    drop_waiting(p);
    timers_.erase({p.due, p.number()});
    const auto of_member = members_.find(p.source().member);
    std::erase(of_member->second, &p);
    if (of_member->second.empty()) {
        members_.erase(of_member);
    }
    if (recent_ == &p) {
        recent_ = nullptr;
    }
    const auto at = peers_.find(p.source());
    peers_.erase(at);
}

void datagram_sessions::forget(std::uint32_t member) {
    half_open_.forget(member);
    while (members_.contains(member)) {
        erase(*members_.find(member)->second.back());
    }
}

void datagram_sessions::on_roster(const roster& before) {
    if (!fleet_.is_same_since(before)) {
        clear();
        return;
    }
    for (const auto& member : before.members()) {
        if (!fleet_.in_force().has(member)) {
            forget(member.number);
        }
    }
}

void datagram_sessions::clear() {
    recent_ = nullptr;
    attempts_.clear();
    timers_.clear();
    members_.clear();
    peers_.clear();
    half_open_.clear();
    waiting_bytes_ = 0;
}

// -- time ----------------------------------------------------------------------------------------------------------

void datagram_sessions::arm(peer& p) {
    auto due = p.retry.due();
    if (const auto begun = p.oldest_begun()) {
        due = std::min(due, *begun + limits_.forget_after);
    }
    if (due != p.due) {
        timers_.erase({p.due, p.number()});
        p.due = due;
        if (due != time_point::max()) {
            timers_.emplace(std::pair{due, p.number()}, &p);
        }
    }
}

std::optional<time_point> datagram_sessions::next_deadline() const {
    auto next = half_open_.next_deadline();
    if (!timers_.empty()) {
        const auto due = timers_.begin()->first.first;
        next = next ? std::min(*next, due) : due;
    }
    return next;
}

void datagram_sessions::on_time(time_point now) {
    if (process_.forked()) {
        clear();
    }
    half_open_.expire(now);
    while (!timers_.empty() && timers_.begin()->first.first <= now) {
        serve(*timers_.begin()->second, now);
    }
}

void datagram_sessions::serve(peer& p, time_point now) {
    p.drop_begun_until(now - limits_.forget_after);
    bool gave_up = false;
    if (p.retry.due() <= now) {
        gave_up = !p.retry.expire(now);
        if (gave_up) {
            end_attempt(p);
            if (const auto* const session = p.unconfirmed()) {
                p.drop(*session);
            }
        } else if (p.trying != nullptr) {
            send_again(p);
        } else {
            send_in(p, *p.unconfirmed(), {}, now);
        }
    }
    const auto source = p.source();
    const bool lost = p.newest() == nullptr;
    if (gave_up && lost) {
        drop_waiting(p);
    }
    if (p.is_idle() && !sink_.holds(source)) {
        erase(p);
    } else {
        arm(p);
    }
    if (gave_up) {
        sink_.gave_up(source, lost);
    }
}

} // namespace cles::security
