// SPDX-License-Identifier: BSL-1.0
#include "node/session/task_types.hpp"

#include <cles/json_reader.hpp>

#include "json/json_members.hpp"
#include "node/session/request_checks.hpp"
#include "protocol/fnv1a.hpp"
#include "protocol/hex_number.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace cles {
namespace core {
namespace {

std::string digest_of(const node_state& n) {
    auto hash = protocol::fnv1a_basis;
    for (const auto& [task, handlers] : n.tasks.tasks()) {
        for (std::size_t i = 0; i < verb_count; ++i) {
            if (handlers[i].present && !handlers[i].info.types.empty()) {
                // Separated by a byte that none of them contains.
                for (const auto text :
                     {std::string_view{task}, verb_names[i], std::string_view{handlers[i].info.types}}) {
                    hash = protocol::fnv1a(std::string_view{"\0", 1}, protocol::fnv1a(text, hash));
                }
            }
        }
    }
    return protocol::hex_text(hash);
}

// What programs set by themselves may be anything; a line feed would end the reply.
bool can_be_told(const std::string& types) {
    return !types.empty() && types.find('\n') == std::string::npos && is_valid_json(types);
}

// {"PUSH":{"body":{...}},"BIND":{"updates":{...}}}: the verbs that tell something.
void serve_types(node_state& host, reply_writer& replies, const protocol::request_line& r, std::string_view task) {
    const auto& tasks = host.tasks.tasks();
    const auto found = tasks.find(task);
    if (found == tasks.end() && !host.published.knows(task)) {
        replies.fail(r, errc::no_task, host.name + " has no task '" + std::string{task} + "'");
        return;
    }
    replies.write(r, [&](json_writer& w) {
        w.begin_object();
        for (std::size_t i = 0; found != tasks.end() && i < verb_count; ++i) {
            const auto& entry = found->second[i];
            if (entry.present && can_be_told(entry.info.types)) {
                w.plain_key(verb_names[i]);
                w.raw(entry.info.types);
            }
        }
        w.end_object();
    });
}

// Whether that peer may bind the noun: what decides about a BIND decides here, too.
bool may_bind(node_state& host, const identity& peer, const protocol::request_line& r, const std::string& path) {
    const auto whole = "self:" + path;
    std::string why;
    auto asked = r;
    asked.verb = verb::bind;
    return protocol::parse_noun(whole, asked.noun, why) && allows(host, peer, asked);
}

void serve_nouns(node_state& host, reply_writer& replies, const protocol::request_line& r, const identity& peer) {
    constexpr std::size_t spare = 256; // for the head of the reply, and what closes it
    std::vector<std::string> paths;
    std::size_t bytes = spare;
    bool is_cut = false;
    for (const auto& path : host.published.paths()) {
        if (!may_bind(host, peer, r, path)) {
            continue;
        }
        bytes += path.size() + 3; // quotation marks and a comma; a path needs no escapes
        if (bytes > replies.longest()) {
            is_cut = true;
            break;
        }
        paths.push_back(path);
    }
    replies.write(r, [&](json_writer& w) {
        w.begin_object();
        write_member(w, "nouns", paths);
        if (is_cut) {
            write_member(w, "more", true);
        }
        w.end_object();
    });
}

bool serve(node_state& host, reply_writer& replies, const protocol::request_line& r, const identity& peer) {
    const auto& parameters = r.noun.parameters;
    if (parameters.size() == 2 && parameters[0] == "types") {
        serve_types(host, replies, r, parameters[1]);
    } else if (parameters.size() == 1 && parameters[0] == "nouns") {
        serve_nouns(host, replies, r, peer);
    } else {
        return false;
    }
    return true;
}

} // namespace
} // namespace core

const detail::types_part* types() noexcept {
    static constexpr detail::types_part part{&core::digest_of, &core::serve};
    return &part;
}

} // namespace cles
