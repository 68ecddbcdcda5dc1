// SPDX-License-Identifier: BSL-1.0
#include "core/onward.hpp"

#include "protocol/grammar.hpp"
#include "protocol/parts.hpp"

namespace cles::core {
namespace {

// A request has 16 at most, and this one bears up to six of ours: id, deadline, progress, urgent, hops, via.
constexpr std::size_t most_foreign = protocol::max_adverbs - 6;

void append_foreign(std::string& out, const protocol::request_line& r) {
    protocol::part_reader parts{r.text};
    parts.next(); // verb
    parts.next(); // noun
    std::size_t count = 0;
    for (auto part = parts.next(); !part.empty() && count < most_foreign; part = parts.next()) {
        protocol::adverb a;
        if (protocol::split_adverb(part, a) && !protocol::is_known_adverb(a.key, r.verb)) {
            out.append(" ").append(part);
            ++count;
        }
    }
}

} // namespace

std::string onward_adverbs(const protocol::request_line& r, std::string_view own_name) {
    auto out = "hops=" + std::to_string(r.hops == 0 ? 0 : r.hops - 1) + " via=";
    if (!r.via.empty()) {
        out.append(r.via).push_back(',');
    }
    out.append(own_name);
    append_foreign(out, r);
    return out;
}

} // namespace cles::core
