// SPDX-License-Identifier: BSL-1.0
// What the other end of a new link sends, one line a line of the input: only a member is admitted, only a member gets
// the roster, and only after hello, roster and welcome in this order.
//
// The input's first byte selects the other end's key, what this end knows, and which name it expects. A line `@1`, `@2`
// or `@3` stands for the fleet's roster of that version, `@0` for another fleet's.
#include "security/link_admission.hpp"

#include "fuzz/fuzz.hpp"
#include "protocol/line.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"
#include "security/fleet/fleet_authority.hpp"

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace cles::fuzz {
namespace {

using security::link_admission;

constexpr std::size_t max_short_line = 1024;

security::signing_key key_of(std::uint8_t number) {
    security::secret_bytes seed{32};
    seed.data()[0] = number;
    return security::signing_key{std::move(seed)};
}

/// Versions 1 to 3 of a fleet: this node, then with car2, then with car3 but without car2; and version 9 of another.
struct rosters {
    rosters() {
        auto authority = security::fleet_authority::found(key_of(0));
        authority.add({"car1", key_of(1).public_part()});
        authority.add({"car2", key_of(2).public_part()});
        versions[0] = authority.share(); // version 3
        authority.add({"car3", key_of(3).public_part()});
        versions[1] = authority.share();
        authority.remove("car2");
        versions[2] = authority.share();
        auto other = security::fleet_authority::found(key_of(9));
        for (int i = 0; i < 8; ++i) {
            other.rotate();
        }
        foreign = other.share();
    }
    std::array<std::shared_ptr<const security::roster>, 3> versions;
    std::shared_ptr<const security::roster> foreign;
};

std::string expanded(std::string_view line, const rosters& all) {
    if (line.size() == 2 && line[0] == '@' && line[1] >= '0' && line[1] <= '3') {
        const auto& chosen = line[1] == '0' ? all.foreign : all.versions[static_cast<std::size_t>(line[1] - '1')];
        return "PUSH self:cles/roster reply=no " + chosen->line();
    }
    return std::string{line};
}

void check_output(std::string_view out, const security::fleet& own, const security::public_key& peer) {
    while (!out.empty()) {
        const auto end = out.find('\n');
        require(end != std::string_view::npos, "whole lines are sent", out);
        const auto line = out.substr(0, end);
        out.remove_prefix(end + 1);
        protocol::request_line said;
        protocol::malformed_request wrong;
        require(protocol::is_failure(line) || protocol::parse_request(line, said, wrong), "what is sent is valid",
                line);
        if (line.starts_with("PUSH self:cles/roster ")) {
            require(own.in_force().find(peer) != nullptr, "only a member gets the roster");
        } else {
            require(line.size() <= max_short_line, "other lines are short", line);
        }
    }
}

} // namespace

void run(std::string_view input) {
    static const rosters all;
    if (input.empty()) {
        return;
    }
    const auto selected = static_cast<unsigned char>(input.front());
    input.remove_prefix(1);
    const auto peer = key_of(static_cast<std::uint8_t>(2 + (selected & 3U))).public_part();
    const auto terms = std::make_shared<security::admission_terms>();
    terms->fleet = std::make_shared<security::fleet>("car1", key_of(1), all.versions[(selected >> 2U) % 3]);
    terms->epoch = "5f3a09c1";
    const auto first_version = terms->fleet->in_force().version();
    const std::string expected = (selected & 0x80U) != 0 ? "car2" : "";

    {
        link_admission admission{terms, expected};
        std::string out;
        admission.begin(peer, out);
        check_output(out, *terms->fleet, peer);
        std::size_t taken = 0;
        auto result = link_admission::verdict::pending;
        while (result == link_admission::verdict::pending && !input.empty()) {
            const auto end = input.find('\n');
            const auto line = expanded(input.substr(0, end), all);
            input.remove_prefix(end == std::string_view::npos ? input.size() : end + 1);
            if (line.size() > admission.max_line()) {
                break;
            }
            out.clear();
            result = admission.on_part(line.size(), out);
            if (result == link_admission::verdict::pending) {
                result = admission.on_line(line, out);
            }
            ++taken;
            check_output(out, *terms->fleet, peer);
            require(taken <= 3, "at most hello, roster and welcome are taken", line);
            require(terms->rosters_of_strangers.size() <= 1, "one link counts once");
        }
        require(terms->fleet->in_force().version() >= first_version, "a roster is never replaced by an older one");
        if (result == link_admission::verdict::admitted) {
            const auto* found = terms->fleet->in_force().find(peer);
            require(found != nullptr && found->name == admission.name(), "only a member is admitted, by its name");
            require(expected.empty() || admission.name() == expected, "it has the expected name", admission.name());
            require(protocol::parse_epoch(admission.epoch()).has_value(), "it has stated an epoch", admission.epoch());
            require(taken >= 2, "it has said hello and welcome");
        } else if (result == link_admission::verdict::refused) {
            require(!admission.why().empty() && admission.refused_for() != link_admission::reason::none,
                    "a refusal has a reason");
        }
    }
    require(terms->rosters_of_strangers.size() == 0, "a link that is gone does not count");
}

} // namespace cles::fuzz
