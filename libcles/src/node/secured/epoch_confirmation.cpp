// SPDX-License-Identifier: BSL-1.0
#include "node/secured/epoch_confirmation.hpp"

#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>

#include "json/json_members.hpp"
#include "node/node_state.hpp"
#include "node/secured/signed_announcer.hpp"
#include "port/node_security.hpp"

#include <algorithm>
#include <cstdint>
#include <utility>

namespace cles::core {
namespace {

constexpr std::size_t reply_depth = 10; // of an announcement, and what it is in

// 16 bytes as base64url, in their only spelling. Nodes sign nothing else.
bool is_challenge(std::string_view text) noexcept {
    constexpr std::size_t digits = 22;
    const auto is_digit = [](char c) {
        return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
    };
    return text.size() == digits && std::ranges::all_of(text, is_digit) &&
           std::string_view{"AQgw"}.find(text.back()) != std::string_view::npos;
}

std::string path_of(std::string_view challenge) { return std::string{"cles/announced/"}.append(challenge); }

} // namespace

std::string epoch_question(std::string_view node, std::string_view challenge) {
    return std::string{node} + ":" + path_of(challenge);
}

std::optional<confirmed_epoch> read_confirmed_epoch(std::string_view json, std::string_view node,
                                                    std::string_view challenge, const node_security& security) {
    signed_entry entry;
    json_reader r{json, reply_depth};
    const bool good = read_members(r, [&](std::string_view key) { return read_signed_member(r, key, entry); });
    announcement said;
    if (!good || !entry.epoch || !read_announcement(entry.body, said) || said.node != node ||
        !security.is_signed(node, path_of(challenge), entry.seq, protocol::epoch_text(*entry.epoch), entry.body,
                            entry.sig)) {
        return {};
    }
    return confirmed_epoch{*entry.epoch, std::move(said.signed_tasks)};
}

// What it announces to others now, also if it has nobody to announce it to.
void serve_announced(node_state& host, reply_writer& replies, const protocol::request_line& r) {
    const std::string challenge{r.noun.parameters[1]};
    if (r.verb != verb::pull || !is_challenge(challenge)) {
        replies.fail(r, errc::bad_request, host.name + ": ask with PULL, and 16 random bytes in base64url");
        return;
    }
    const auto* const own = host.peers.own();
    auto said = own != nullptr ? own->announced : announcement{.node = host.name, .pool = host.peers.pool()};
    said.load = host.load_now();
    said.roster = host.security->roster_version();
    said.signed_tasks = host.tasks.signed_tasks();
    const auto seq = own != nullptr ? own->seq : 1;
    const auto made = sign_announcement(said, path_of(challenge), seq, host.epoch, *host.security);
    replies.write(r, [&](json_writer& w) {
        w.begin_object();
        write_signed_members(w, *made, seq, host.epoch);
        w.end_object();
    });
}

} // namespace cles::core
