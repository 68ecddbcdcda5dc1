// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>

#include <string>
#include <string_view>

namespace cles::runtime {

/// What a person reads, on one line: "sat1 tcp://127.0.0.1:4242 id=7: denied". Control characters become escapes, so
/// that a peer's text cannot drive a terminal, nor begin a line of its own.
std::string text_of(std::string_view node, const log_entry& entry);

/// The same as members of a JSON object, without its brackets: `"node":"sat1","peer":"tcp://…","id":7,"message":"…"`.
/// Those that there are none of are left out.
std::string json_of(std::string_view node, const log_entry& entry);

} // namespace cles::runtime
