// SPDX-License-Identifier: BSL-1.0
// Rosters and the lines of key files. An input that is not a whole line is the content of a roster, which is signed
// here, so that what is behind the signature is reached.

#include "security/fleet/roster.hpp"

#include "fuzz/fuzz.hpp"
#include "protocol/grammar.hpp"
#include "security/fleet/fleet.hpp"
#include "security/fleet/fleet_authority.hpp"
#include "security/keys/identity.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <string>

namespace cles::fuzz {
namespace {

using namespace security;

// The fleet's key of test/security/vectors.json, so that its roster is an input.
signing_key fleet_key() {
    constexpr std::array<std::uint8_t, 32> seed{0xe8, 0x6a, 0xbb, 0x4a, 0x48, 0xc9, 0x25, 0x63, 0x20, 0x2f, 0x5d,
                                                0x9a, 0xea, 0xcd, 0x3c, 0xef, 0xf6, 0x57, 0x56, 0xe3, 0x1f, 0xa9,
                                                0x71, 0x01, 0x39, 0x89, 0xbf, 0xd2, 0xf8, 0x5e, 0x49, 0x4b};
    return signing_key{secret_bytes{seed}};
}

void check(const roster& read, std::string_view input) {
    require(read.line().size() <= max_roster_line, "a line is bounded", input);
    require(read.version() >= 1 && read.generation() >= 1 && read.generation() <= max_generation,
            "numbers are in range");
    require(read.oldest() >= 1 && read.oldest() <= read.generation() && read.generation() - read.oldest() <= 1,
            "the previous generation at most is accepted", input);
    require(read.members().size() <= max_members && read.last() <= max_member_number, "members are bounded", input);
    std::uint32_t number = 0;
    for (const auto& entry : read.members()) {
        require(entry.number > number && entry.number <= read.last(), "numbers ascend", input);
        number = entry.number;
        require(protocol::is_name(entry.name) && !protocol::is_reserved_target(entry.name), "a member has a name",
                input);
        require(agreement_form(entry.key) == entry.agreement, "a member has a key", input);
        require(read.find(entry.number) == &entry && read.find(entry.name) == &entry && read.find(entry.key) == &entry,
                "a member is found, and only by what is its own", input);
    }
}

void check_again(const roster& read, std::string_view input) {
    const auto again = roster::read(read.line(), read.fleet(), &read);
    require(
        again->content() == read.content() && again->members().size() == read.members().size() &&
            std::ranges::equal(again->members(), read.members(), [](const auto& a, const auto& b) { return a.is(b); }),
        "reading does not depend on what was known", input);
}

void check_node(const std::shared_ptr<const roster>& read, std::string_view input) {
    fleet node{"nobody", fleet_key(), fleet_authority::found(fleet_key()).share()};
    const auto result = node.offer(read->line());
    require(result == (read->version() > 1 ? fleet::verdict::adopted : fleet::verdict::forked),
            "a newer roster comes into force", input);
    require(node.offer(node.in_force().line()) == fleet::verdict::known, "what is in force is known", input);
}

void check_authority(const std::shared_ptr<const roster>& read, std::string_view input) {
    try {
        fleet_authority authority{fleet_key(), read};
        authority.rotate();
        require(authority.newest().version() == read->version() + 1, "a version follows another", input);
        require(std::ranges::equal(authority.newest().members(), read->members(),
                                   [](const auto& a, const auto& b) {
                                       return a.is(b) && a.may == b.may && a.offers == b.offers &&
                                              a.forwards == b.forwards;
                                   }),
                "rotation changes no member", input);
    } catch (const security_error& e) {
        require(!std::string_view{e.what()}.starts_with("the roster is malformed"), "a roster leads to a roster",
                input);
    }
}

void read_content(std::string_view content) {
    const auto key = fleet_key();
    std::shared_ptr<const roster> read;
    try {
        read = roster::read(roster::sign(content, key), key.public_part());
    } catch (const security_error& e) {
        require(*e.what() != '\0', "a mistake has a name", content);
        return;
    }
    check(*read, content);
    check_again(*read, content);
    check_node(read, content);
    check_authority(read, content);
}

void read_line(std::string_view line) {
    try {
        const auto read = roster::read(line, roster::named_fleet(line));
        check(*read, line);
    } catch (const security_error& e) {
        require(*e.what() != '\0', "a mistake has a name", line);
    }
}

// Calls `read`, and `check` with what it returns.
template <class Read, class Check>
void try_line(Read read, Check check_result) {
    try {
        const auto result = read();
        check_result(result);
    } catch (const security_error&) { // not such a line
    }
}

void read_key_line(std::string_view line) {
    const bytes_view bytes{reinterpret_cast<const std::uint8_t*>(line.data()), line.size()};
    const auto is_same = [&](bytes_view written) {
        const auto shortest = line.substr(0, line.size() - (line.ends_with('\n') ? 1 : 0));
        require(std::ranges::equal(written.first(written.size() - 1), shortest,
                                   [](auto a, char b) { return a == static_cast<std::uint8_t>(b); }),
                "a key line has one spelling", line);
    };
    try_line([&] { return read_node_identity(bytes); }, [&](const auto& read) { is_same(to_line(read).view()); });
    try_line([&] { return read_fleet_key(bytes); }, [&](const auto& read) { is_same(fleet_key_line(read).view()); });
    try_line([&] { return read_public_identity(line); },
             [&](const auto& read) {
                 const auto written = to_line(read);
                 is_same({reinterpret_cast<const std::uint8_t*>(written.data()), written.size()});
             });
}

} // namespace

void run(std::string_view input) {
    if (input.size() > max_roster_line) {
        return;
    }
    read_content(input.substr(0, max_roster_line - 200));
    read_line(input);
    read_key_line(input);
}

} // namespace cles::fuzz
