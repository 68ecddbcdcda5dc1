// SPDX-License-Identifier: BSL-1.0
// A link's address: what is read can be written, and read again with the same result.
#include <cles/error.hpp>
#include <cles/url.hpp>

#include "fuzz/fuzz.hpp"

namespace cles::fuzz {

void run(std::string_view input) {
    url first;
    try {
        first = parse_url(input);
    } catch (const error& e) {
        require(e.code() == errc::invalid_url && !e.message().empty(), "a refusal says why", input);
        return;
    }
    require(!first.scheme.empty(), "a URL has a scheme", input);
    require(first.scheme == "unix" ? !first.path.empty() : !first.host.empty(), "a URL leads somewhere", input);

    const auto text = to_string(first);
    url again;
    try {
        again = parse_url(text);
    } catch (const error& e) {
        require(false, "what is written can be read", text);
    }
    require(again.scheme == first.scheme && again.host == first.host && again.port == first.port &&
                again.path == first.path,
            "it leads to the same place", text);
    require(to_string(again) == text, "it is written the same", text);
}

} // namespace cles::fuzz
