// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/fleet_authority.hpp"

#include "json/json_members.hpp"
#include "json/json_scan.hpp"
#include "protocol/grammar.hpp"
#include "security/fleet/member_file.hpp"

#include <algorithm>
#include <utility>

namespace cles::security {
namespace {

using core::write_member;

void write_entry(json_writer& out, const member& entry) {
    out.begin_object();
    write_member(out, "number", entry.number);
    write_member(out, "name", entry.name);
    write_member(out, "key", to_base64url(entry.key));
    write_member(out, "keys", entry.group_keys);
    if (entry.may) {
        write_member(out, "may", *entry.may);
    }
    if (entry.offers) {
        write_member(out, "offers", *entry.offers);
    }
    if (!entry.forwards.empty()) {
        write_member(out, "forwards", entry.forwards);
    }
    out.end_object();
}

void permit(member& entry, const member_rights& rights) {
    const auto check = [](const std::vector<std::string>& texts) {
        for (const auto& text : texts) {
            if (!json_detail::is_utf8(text)) {
                throw security_error{protocol::quoted(text) + " is not UTF-8"};
            }
        }
    };
    check(rights.may.value_or(std::vector<std::string>{}));
    check(rights.offers.value_or(std::vector<std::string>{}));
    check(rights.forwards);
    static_cast<member_rights&>(entry) = rights;
}

} // namespace

// The next roster, before it is signed.
struct fleet_authority::draft {
    std::uint32_t version = 1;
    std::uint32_t last = 0;
    std::uint32_t generation = 1;
    std::uint32_t oldest = 1;
    group_keys keys{};
    std::string authority_keys{};
    std::vector<member> members{};

    [[nodiscard]] std::vector<member>::iterator find(std::string_view name) {
        const auto found = std::ranges::find(members, name, &member::name);
        if (found == members.end()) {
            throw security_error{protocol::quoted(name) + " is not a member of the fleet"};
        }
        return found;
    }

    void seal(const signing_key& fleet_key) {
        authority_keys = seal_group_keys(keys, fleet_key.agreement_part());
        for (auto& entry : members) {
            entry.group_keys = seal_group_keys(keys, entry.agreement);
        }
    }

    void next_generation(std::uint32_t steps) {
        if (generation > max_generation - steps) {
            throw security_error{"the generations of the group key are used up: a new fleet is required"};
        }
        generation += steps;
    }

    [[nodiscard]] std::string content(const public_key& fleet) const {
        std::string text;
        json_writer out{text};
        out.begin_object();
        write_member(out, "fleet", to_base64url(fleet));
        write_member(out, "version", version);
        write_member(out, "last", last);
        write_member(out, "generation", generation);
        write_member(out, "oldest", oldest);
        write_member(out, "keys", authority_keys);
        out.plain_key("members");
        out.begin_array();
        for (const auto& entry : members) {
            write_entry(out, entry);
        }
        out.end_array();
        out.end_object();
        return text;
    }
};

fleet_authority fleet_authority::found(signing_key fleet_key) {
    draft first{.keys = group_keys::random()};
    first.seal(fleet_key);
    const auto line = roster::sign(first.content(fleet_key.public_part()), fleet_key);
    auto read = roster::read(line, fleet_key.public_part());
    return {std::move(fleet_key), std::move(read)};
}

fleet_authority::fleet_authority(signing_key fleet_key, std::shared_ptr<const roster> newest)
    : key_(std::move(fleet_key)), newest_(std::move(newest)) {
    if (newest_->fleet() != key_.public_part()) {
        throw security_error{"the roster is of another fleet than the key"};
    }
    if (!newest_->ignored_key().empty()) {
        throw security_error{"the roster contains " + protocol::quoted(newest_->ignored_key()) +
                             ", which this version would drop: use the version that wrote it, or a later one"};
    }
    keys_ = open_group_keys(newest_->authority_keys(), key_);
}

fleet_authority::draft fleet_authority::next_version() const {
    if (newest_->version() == max_version) {
        throw security_error{"the versions of the roster are used up: a new fleet is required"};
    }
    return {.version = newest_->version() + 1,
            .last = newest_->last(),
            .generation = newest_->generation(),
            .oldest = newest_->oldest(),
            .keys = {.current = keys_.current.copy(), .next = keys_.next.copy()},
            .authority_keys = newest_->authority_keys(),
            .members = newest_->members()};
}

// Reads what it wrote, so that no roster is published that nodes would refuse.
void fleet_authority::publish(const draft& next) {
    const auto line = roster::sign(next.content(key_.public_part()), key_);
    group_keys keys{.current = next.keys.current.copy(), .next = next.keys.next.copy()};
    newest_ = roster::read(line, key_.public_part(), newest_.get());
    keys_ = std::move(keys);
}

void fleet_authority::add(std::span<const public_identity> nodes, const member_rights& rights) {
    auto next = next_version();
    if (nodes.size() > max_members - next.members.size()) {
        throw security_error{"a fleet has at most 4096 members"};
    }
    for (const auto& node : nodes) {
        require_member_name(node.name); // before the roster is stored, since a file is written for it afterwards
        if (newest_->find(node.name) != nullptr) {
            throw security_error{node.name + " is already a member: remove it first if it has a new key"};
        }
        if (const auto* const same = newest_->find(node.key); same != nullptr) {
            throw security_error{"the key of " + protocol::quoted(node.name) + " is that of the member " + same->name};
        }
        if (next.last == max_member_number) {
            throw security_error{"the numbers of members are used up: a new fleet is required"};
        }
        const auto form = agreement_form(node.key);
        if (!form) {
            throw security_error{"the key of " + protocol::quoted(node.name) + " is not valid"};
        }
        member entry;
        permit(entry, rights);
        entry.number = ++next.last;
        entry.name = node.name;
        entry.key = node.key;
        entry.agreement = *form;
        entry.group_keys = seal_group_keys(next.keys, *form);
        next.members.push_back(std::move(entry));
    }
    publish(next);
}

void fleet_authority::set_rights(std::string_view name, const member_rights& rights) {
    auto next = next_version();
    permit(*next.find(name), rights);
    publish(next);
}

void fleet_authority::remove(std::span<const std::string> names) {
    auto next = next_version();
    for (const auto& name : names) {
        next.members.erase(next.find(name));
    }
    next.next_generation(2);
    next.oldest = next.generation;
    next.keys = group_keys::random();
    next.seal(key_);
    publish(next);
}

void fleet_authority::rotate() {
    auto next = next_version();
    next.oldest = next.generation;
    next.next_generation(1);
    next.keys = {.current = keys_.next.copy(), .next = secret_bytes::random(group_key_size)};
    next.seal(key_);
    publish(next);
}

} // namespace cles::security
