// SPDX-License-Identifier: BSL-1.0
// A verb and a noun in the first line, and a right in each further one: a right of another form permits nothing and
// says why, and one that is valid permits what the simplest reading of it does.
#include "security/access/rights.hpp"

#include "fuzz/fuzz.hpp"
#include "fuzz/naive_rights.hpp"

namespace cles::fuzz {

void run(std::string_view input) {
    constexpr std::size_t longest = 400; // the simple reading takes time in proportion to the product of the lengths
    const auto lines = split(input, '\n');
    const auto words = split(lines.front(), ' ');
    protocol::noun_view parts;
    std::string why;
    const auto asked = verb_from(words.front());
    const bool is_asked = asked && words.size() == 2 &&
                          words[0].find_first_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ") == std::string::npos &&
                          protocol::parse_noun(words[1], parts, why);
    for (std::size_t i = 1; i < lines.size(); ++i) {
        why.clear();
        const auto read = security::right::parse(lines[i], &why);
        require(read.has_value() == why.empty(), "a right of another form says why", lines[i]);
        if (read && is_asked && words[1].size() <= longest && lines[i].size() <= longest) {
            const security::decoded_noun noun{parts.target, parts};
            require(read->permits(*asked, noun) == naive_permits(lines[i], words[0], words[1]),
                    "a right permits what it says", lines[i] + "' of '" + lines.front());
        }
    }
}

} // namespace cles::fuzz
