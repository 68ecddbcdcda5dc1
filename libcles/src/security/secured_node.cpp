// SPDX-License-Identifier: BSL-1.0
#include "security/secured_node.hpp"

#include <cles/error.hpp>

#include "port/ip_network.hpp"
#include "security/datagrams/sealed_group_port.hpp"
#include "security/keys/signed_text.hpp"
#include "security/messages/sealed_messages.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

namespace cles::security {
namespace {

std::string host_text(const datagram_path& at) {
    core::ip_address address{.is_v6 = !at.is_v4(), .bytes = at.v6_address()};
    if (at.is_v4()) { // the last bytes of ::ffff:10.0.0.1
        std::rotate(address.bytes.begin(), address.bytes.end() - 4, address.bytes.end());
        std::fill(address.bytes.begin() + 4, address.bytes.end(), std::uint8_t{0});
    }
    return core::to_text(address);
}

} // namespace

secured_node::secured_node(const std::string& directory) : directory_(directory), files_(file_state()) {
    auto found = directory_.read_node();
    warnings_ = std::move(found.warnings);
    fleet_ = std::make_shared<security::fleet>(found.own.name, std::move(found.own.key), std::move(found.newest));
    datagrams_ = std::make_shared<sealed_datagrams>(*fleet_);
    observation_ = fleet_->observe([this](const roster&) { on_roster(); }); // links bring rosters, too
    rules_ = read_local_rules(directory_.folder());
    adopt_changes();
}

secured_node::~secured_node() = default;

void secured_node::log(log_level level, std::string text) const {
    if (observer_ != nullptr) {
        observer_->on_security_log(level, std::move(text));
    }
}

void secured_node::log_refused_link(const refused_link& link) {
    log_refusal(log_kind_of(link.kind), link.source, link.why, text_of(link));
}

void secured_node::log_refusal(std::string_view kind, std::string_view source, std::string_view why, std::string text) {
    if (time_ == nullptr) {
        return;
    }
    const auto whose = core::share_of_address(source);
    if (const auto left_out = refusals_.take({.kind = kind, .source = whose, .text = why, .most = 4}, time_->now())) {
        log(log_level::warning, text.append(core::left_out_text(*left_out)));
    }
}

// Anybody can send one in the name of any member, from any address.
void secured_node::log_refused_hello(const datagram_source& by, hello_refusal why) {
    const auto* const member = fleet_->in_force().find(by.member);
    const auto whose = member == nullptr ? "number " + std::to_string(by.member) : member->name;
    const auto in_roster = "in version " + std::to_string(roster_version()) + " of the roster";
    std::string_view kind = "hello.busy";
    auto text = "a HELLO of " + whose + " by UDP was refused: ";
    switch (why) {
    case hello_refusal::not_member:
        kind = "hello.not_member";
        text += "that is no member " + in_roster;
        break;
    case hello_refusal::unproven:
        kind = "hello.unproven";
        text += "it was not made with the key that it has " + in_roster + ", or for another node";
        break;
    case hello_refusal::busy: text += "too many arrive"; break;
    case hello_refusal::none: return;
    }
    const auto host = host_text(by.path);
    log_refusal(kind, host, text, text + " (" + host + ")");
}

// -- its node ------------------------------------------------------------------------------------------------------

void secured_node::begin(std::string_view name, std::uint32_t epoch, const core::clock& time,
                         core::security_observer& observer) {
    if (name != fleet_->name()) {
        throw error(errc::invalid_name, "the key in " + directory_.folder().path() + " is that of '" + fleet_->name() +
                                            "', and this node is '" + std::string{name} + "'");
    }
    observer_ = &observer;
    time_ = &time;
    datagrams_->begin(
        epoch, time,
        {.due =
             [this](time_point at) {
                 next_datagrams_ = at;
                 if (observer_ != nullptr) {
                     observer_->on_due(at);
                 }
             },
         .stated =
             [this](std::uint32_t number, std::uint32_t version) {
                 const auto* const who = fleet_->in_force().find(number);
                 if (who != nullptr && observer_ != nullptr) {
                     observer_->on_stated_roster(who->name, version);
                 }
             },
         .refused = [this](const datagram_source& by, hello_refusal why) { log_refused_hello(by, why); }});
    for (auto& each : std::exchange(warnings_, {})) {
        log(log_level::warning, std::move(each));
    }
    if (rules_.denies_everything()) {
        log(log_level::error, "every request is denied: " + rules_.error());
    }
    store(); // what came in a .join file
    next_check_ = time.now() + check_interval;
    observer.on_due(next_check_);
}

void secured_node::end() {
    observer_ = nullptr;
    datagrams_->end();
}

void secured_node::on_time(time_point now) {
    if (now >= next_datagrams_) {
        next_datagrams_ = time_point::max();
        datagrams_->on_time(now);
    }
    if (now >= next_check_) {
        next_check_ = now + check_interval;
        check_files();
    }
    if (observer_ != nullptr) {
        observer_->on_due(std::min(next_check_, next_datagrams_));
    }
}

// -- who may do what -----------------------------------------------------------------------------------------------

bool secured_node::is_member(std::string_view name) const { return fleet_->in_force().find(name) != nullptr; }

bool secured_node::allows(const core::request_origin& by, std::string_view provider, verb how,
                          const protocol::noun_view& noun) const {
    const bool is_own = by.requester == name() && by.forwarder.empty();
    if (is_own && provider == name()) {
        return true;
    }
    noun_.assign(provider, noun);
    return is_own ? policy_->sent({}, how, noun_).allowed()
                  : policy_->received(by.requester, by.forwarder, how, noun_).allowed();
}

bool secured_node::may_forward(std::string_view forwarder, std::string_view requester) const {
    return is_member(requester) && policy_->may_forward(forwarder, requester);
}

// -- signatures ----------------------------------------------------------------------------------------------------

std::string secured_node::sign_update(std::string_view path, std::uint64_t seq, std::string_view epoch,
                                      std::string_view body) const {
    return sign(fleet_->own_key(), fleet_->in_force().fleet(),
                signed_update{.publisher = name(), .noun = path, .seq = seq, .epoch = epoch, .body = body});
}

bool secured_node::is_signed(std::string_view publisher, std::string_view path, std::uint64_t seq,
                             std::string_view epoch, std::string_view body, std::string_view sig) const {
    const auto* const who = fleet_->in_force().find(publisher);
    return who != nullptr &&
           verify(who->key, fleet_->in_force().fleet(),
                  signed_update{.publisher = publisher, .noun = path, .seq = seq, .epoch = epoch, .body = body}, sig);
}

std::string secured_node::new_challenge() const { return security::new_challenge(); }

std::string secured_node::sign_request(std::string_view node, std::string_view challenge, verb how,
                                       std::string_view path, std::string_view body, std::uint32_t waits_ms) const {
    try {
        return sign(fleet_->own_key(), fleet_->in_force().fleet(),
                    signed_request{.requester = name(),
                                   .node = node,
                                   .challenge = challenge,
                                   .kind = how,
                                   .noun = path,
                                   .body = body,
                                   .waits_ms = waits_ms});
    } catch (const security_error& e) {
        log(log_level::warning, std::string{"a request was not signed: "} + e.what());
        return {};
    }
}

bool secured_node::is_request_signed(std::string_view requester, std::string_view challenge, verb how,
                                     std::string_view path, std::string_view body,
                                     const protocol::request_signature& sig) const {
    const auto* const who = fleet_->in_force().find(requester);
    return who != nullptr && verify(who->key, fleet_->in_force().fleet(),
                                    signed_request{.requester = requester,
                                                   .node = name(),
                                                   .challenge = challenge,
                                                   .kind = how,
                                                   .noun = path,
                                                   .body = body,
                                                   .waits_ms = sig.waits_ms},
                                    sig.signature);
}

std::shared_ptr<core::group_port> secured_node::seal(std::shared_ptr<core::group_port> port) {
    return std::make_shared<sealed_group_port>(datagrams_, std::move(port),
                                               [this](std::uint32_t member, const std::vector<std::string>& endpoints) {
                                                   report_unanswered(member, endpoints);
                                               });
}

std::unique_ptr<core::message_seal> secured_node::seal_messages() {
    return std::make_unique<sealed_messages>(*fleet_, system_entropy(), [this](std::string_view line) {
        if (const auto refused = offer_roster(line)) {
            const auto why = "a roster of another bridge is refused: " + *refused;
            log_refused_link({.kind = link_admission::reason::none, .why = why}); // of no link, so of a kind of its own
        }
    });
}

void secured_node::report_unanswered(std::uint32_t member, const std::vector<std::string>& endpoints) const {
    const auto* const who = fleet_->in_force().find(member);
    if (who != nullptr && observer_ != nullptr) {
        observer_->on_unanswered(who->name, endpoints);
    }
}

// -- rosters -------------------------------------------------------------------------------------------------------

std::optional<std::string> secured_node::offer_roster(std::string_view line) {
    std::string why;
    const auto found = fleet_->offer(line, &why);
    if (found == fleet::verdict::refused) {
        return why;
    }
    if (!why.empty()) {
        log(log_level::error, why);
    }
    return {};
}

void secured_node::on_roster() {
    log(log_level::info, "version " + std::to_string(roster_version()) + " of the roster is in force");
    store();
    std::erase_if(asked_, [this](const auto& each) { return !is_member(each.first); });
    adopt_changes();
}

bool secured_node::wants_roster(std::string_view from, std::uint32_t version, time_point now) {
    if (version <= roster_version() || !is_member(from)) {
        return false;
    }
    auto at = asked_.find(from);
    if (at == asked_.end()) {
        at = asked_.emplace(std::string{from}, asked_member{}).first;
    }
    auto& asked = at->second;
    if (asked.version < version) {
        asked.pause = ask_again_after;
    } else if (now - asked.at < asked.pause) {
        return false;
    } else { // the link may have been lost, or it does not have that roster
        asked.pause = std::min<std::chrono::seconds>(2 * asked.pause, longest_pause);
    }
    asked.version = version;
    asked.at = now;
    return true;
}

// A node that cannot store it goes on with it, and receives it again after a restart. What others have changed in the
// directory is still to be read.
void secured_node::store() {
    const bool is_unchanged = roster_state() == files_.roster;
    try {
        if (directory_.store_roster(fleet_->in_force()) && is_unchanged) {
            files_.roster = roster_state();
        }
    } catch (const security_error& e) {
        log(log_level::error, std::string{"the roster cannot be stored: "} + e.what());
    }
}

void secured_node::adopt_changes() {
    policy_ = std::make_unique<access_policy>(name(), fleet_->share(), rules_);
    if (observer_ != nullptr) {
        observer_->on_security_changed();
    }
}

// -- files ---------------------------------------------------------------------------------------------------------

std::string secured_node::roster_state() const { return directory_.folder().state_of({"roster"}); }

secured_node::directory_state secured_node::file_state() const {
    std::vector<std::string> names{"rules"};
    try {
        for (auto& each : directory_.folder().names_ending(".join")) {
            names.push_back(std::move(each));
        }
    } catch (const security_error&) { // reported when they are read
    }
    return {roster_state(), directory_.folder().state_of(names)};
}

void secured_node::check_files() {
    auto now = file_state();
    if (now == files_) {
        return;
    }
    files_ = std::move(now);
    rules_ = read_local_rules(directory_.folder());
    if (rules_.denies_everything()) {
        log(log_level::error, "every request is denied: " + rules_.error());
    }
    const auto before = roster_version();
    try {
        std::vector<std::string> warnings;
        const auto newest = directory_.read_newest_roster(warnings);
        for (auto& each : warnings) {
            log(log_level::warning, std::move(each));
        }
        if (newest && newest->version() > before) {
            if (const auto why = offer_roster(newest->line())) {
                log(log_level::error, "a roster in " + directory_.folder().path() + " is refused: " + *why);
            }
        }
    } catch (const security_error& e) {
        log(log_level::error, e.what());
    }
    if (roster_version() == before) { // else `on_roster` has adopted the rules, too
        adopt_changes();
    }
}

} // namespace cles::security
