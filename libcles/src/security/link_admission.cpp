// SPDX-License-Identifier: BSL-1.0
#include "security/link_admission.hpp"

#include <cles/json_reader.hpp>
#include <cles/printable.hpp>

#include "port/ip_network.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"
#include "security/fleet/roster.hpp"

#include <algorithm>
#include <utility>

namespace cles::security {
namespace {

constexpr std::size_t max_short_line = 1024; // any but the roster's
constexpr std::size_t max_quoted = 200;      // of what the other end says
constexpr std::string_view roster_head = "PUSH self:cles/roster reply=no ";
constexpr const char* too_many_rosters = "too many rosters arrive at the same time";

struct hello {
    std::uint32_t version = 0;
    std::string epoch{};
};

void append_push(std::string& out, std::string_view noun, std::string_view body = {}) {
    protocol::append_request(out, {.verb = verb::push, .noun = noun, .wants_reply = false, .body = body});
}

void append_refusal(std::string& out, errc code, const std::string& message) {
    protocol::append_failure(out, {.code = code, .message = message});
    out.push_back('\n');
}

std::optional<hello> read_hello(std::string_view body) {
    hello said;
    json_reader reader{body};
    std::string_view key;
    reader.begin_object();
    while (reader.next_key(key)) {
        std::string_view raw;
        if (key == "version" && said.version == 0 && reader.read_raw(raw)) {
            said.version = static_cast<std::uint32_t>(protocol::number_between(raw, 1, max_version).value_or(0));
            if (said.version == 0) {
                return std::nullopt;
            }
        } else if (key == "epoch" && said.epoch.empty() && reader.read(raw)) {
            if (!protocol::parse_epoch(raw)) {
                return std::nullopt;
            }
            said.epoch = raw;
        } else {
            reader.skip();
        }
    }
    return reader.at_end() && said.version != 0 && !said.epoch.empty() ? std::optional{said} : std::nullopt;
}

// The beginning of a failure's message.
std::string quoted_message(std::string_view body) {
    protocol::failure said;
    if (!protocol::parse_failure(body, said)) {
        return {};
    }
    return printable(std::string_view{said.message}.substr(0, max_quoted)); // the last character may be cut
}

} // namespace

link_admission::link_admission(std::shared_ptr<admission_terms> terms, std::string expected, std::string_view host)
    : terms_(std::move(terms)), expected_(std::move(expected)), source_(core::share_of_address(host)) {}

link_admission::~link_admission() = default;

bool link_admission::take_handshake(time_point now) {
    handshake_ = terms_->handshakes.take(source_, now);
    if (handshake_ == admission_terms::handshake_turns::turn::refused) {
        refuse(reason::busy, "too many links are being opened");
        return false;
    }
    return true;
}

void link_admission::begin(const public_key& peer, std::string& out) {
    key_ = peer;
    stated_ = terms_->fleet->in_force().version();
    append_push(out, "self:cles/hello",
                R"({"version":)" + std::to_string(stated_) + R"(,"epoch":")" + terms_->epoch + R"("})");
}

std::size_t link_admission::max_line() const noexcept {
    return stage_ == stage::roster ? roster_head.size() + max_roster_line : max_short_line;
}

link_admission::verdict link_admission::on_line(std::string_view line, std::string& out) {
    if (protocol::is_failure(line)) {
        return refuse(reason::by_peer, "the other end refused the link: " + quoted_message(line));
    }
    protocol::request_line said;
    protocol::malformed_request wrong;
    if (protocol::parse_request(line, said, wrong) && said.verb == verb::push && said.noun.target == "self" &&
        said.noun.task == "cles" && said.noun.parameters.size() == 1 && !said.wants_reply && said.id == 0) {
        const auto what = said.noun.parameters.front();
        if (stage_ == stage::hello && what == "hello") {
            return on_hello(said.body, out);
        }
        if (stage_ == stage::roster && what == "roster") {
            return on_roster(said.body, out);
        }
        if (stage_ == stage::welcome && what == "welcome") {
            return on_welcome();
        }
    }
    return refuse(reason::protocol, "the other end sent another line before its welcome");
}

// Both ends compare the versions that were stated, so that they agree on who sends a roster, even if one of them has
// received a newer one meanwhile.
link_admission::verdict link_admission::on_hello(std::string_view body, std::string& out) {
    const auto said = read_hello(body);
    if (!said) {
        return refuse(reason::protocol, "the other end's hello is malformed");
    }
    epoch_ = said->epoch;
    if (said->version > stated_) {
        stage_ = stage::roster;
        return verdict::pending;
    }
    if (said->version < stated_ && find_peer() != nullptr) {
        out.append(roster_head).append(terms_->fleet->in_force().line()).push_back('\n');
    }
    return look_up(out);
}

// A stated version uses up nothing, since anybody can state any. Only what arrives of a long roster counts.
link_admission::verdict link_admission::on_part(std::size_t size, std::string& out) {
    if (stage_ != stage::roster || size <= admission_terms::short_roster || find_peer() != nullptr ||
        make_space_for_roster(size)) {
        return verdict::pending;
    }
    append_refusal(out, errc::busy, too_many_rosters);
    return refuse(reason::busy, too_many_rosters);
}

bool link_admission::make_space_for_roster(std::size_t size) {
    auto& places = terms_->rosters_of_strangers;
    const std::size_t own_others = places.held_by(source_) - (roster_place_.is_held() ? 1 : 0);
    while (places.amount() - roster_place_.amount() + size > admission_terms::long_rosters) {
        auto* const other = places.first_to_yield();
        if (other == nullptr || other->source_ == source_ || places.held_by(other->source_) <= own_others) {
            return false;
        }
        other->displace();
    }
    if (!roster_place_.is_held()) {
        roster_place_ = places.take(source_, *this);
    }
    roster_place_.set_amount(size);
    return true;
}

void link_admission::displace() {
    refuse(reason::busy, too_many_rosters);
    if (displaced_) {
        std::string line;
        append_refusal(line, errc::busy, too_many_rosters);
        displaced_(line);
    }
}

link_admission::verdict link_admission::on_roster(std::string_view body, std::string& out) {
    roster_place_.release();
    std::string why;
    if (terms_->fleet->offer(body, &why) == fleet::verdict::refused) {
        append_refusal(out, errc::denied, "the roster was refused: " + why);
        return refuse(reason::not_member, "the other end's roster was refused: " + why);
    }
    return look_up(out);
}

link_admission::verdict link_admission::look_up(std::string& out) {
    const auto* found = find_peer();
    if (found == nullptr) {
        const auto version = std::to_string(terms_->fleet->in_force().version());
        append_refusal(out, errc::denied, "the key of this node is not in roster " + version);
        if (const auto* const former = terms_->fleet->find_former(key_)) {
            return refuse(reason::removed,
                          *former + " was removed from the fleet: its key is not in roster " + version);
        }
        return refuse(reason::not_member, "the other end's key is not in roster " + version);
    }
    if (!expected_.empty() && found->name != expected_) {
        return refuse(reason::other_name, "the other end is " + found->name + ", not " + expected_);
    }
    name_ = found->name;
    number_ = found->number;
    if (const auto* self = terms_->fleet->self()) {
        own_number_ = self->number;
    }
    append_push(out, "self:cles/welcome");
    stage_ = stage::welcome;
    return verdict::pending;
}

link_admission::verdict link_admission::on_welcome() {
    if (!is_in_force()) {
        return refuse(reason::not_member, "a member was removed while the link was opened");
    }
    stage_ = stage::done;
    terms_->handshakes.give_back(source_, handshake_);
    return verdict::admitted;
}

link_admission::verdict link_admission::refuse(reason r, std::string why) {
    roster_place_.release();
    stage_ = stage::done;
    reason_ = r;
    why_ = std::move(why);
    return verdict::refused;
}

const member* link_admission::find_peer() { return terms_->fleet->in_force().find(key_); }

bool link_admission::is_in_force() const {
    const auto* peer = terms_->fleet->in_force().find(key_);
    const auto* self = terms_->fleet->self();
    return peer != nullptr && peer->number == number_ && peer->name == name_ &&
           (!own_number_ || (self != nullptr && self->number == *own_number_));
}

} // namespace cles::security
