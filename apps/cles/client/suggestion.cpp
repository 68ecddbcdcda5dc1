// SPDX-License-Identifier: BSL-1.0
#include "client/suggestion.hpp"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace tool {
namespace {

constexpr std::size_t max_length = 64; // of words worth comparing
constexpr std::size_t min_prefix = 3;  // letters that identify a word

// Letters added, left out, replaced, or swapped with the next one (optimal string alignment).
std::size_t distance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> before_last(b.size() + 1);
    std::vector<std::size_t> last(b.size() + 1);
    std::vector<std::size_t> now(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) {
        last[j] = j;
    }
    for (std::size_t i = 1; i <= a.size(); ++i) {
        now[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            now[j] = std::min({last[j] + 1, now[j - 1] + 1, last[j - 1] + (a[i - 1] == b[j - 1] ? 0U : 1U)});
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
                now[j] = std::min(now[j], before_last[j - 2] + 1);
            }
        }
        std::swap(before_last, last);
        std::swap(last, now);
    }
    return last[b.size()];
}

} // namespace

std::string closest_match(std::string_view typed, const std::vector<std::string>& known) {
    std::string best;
    auto limit = std::clamp<std::size_t>(typed.size() / 3, 1, 3) + 1;
    if (typed.size() > max_length) {
        return best;
    }
    for (const auto& word : known) {
        if (word.size() > max_length || word == typed) {
            continue;
        }
        const bool is_prefix = typed.size() >= min_prefix && word.starts_with(typed);
        const auto edits = is_prefix ? 1 : distance(typed, word);
        if (edits < limit && edits < word.size()) {
            limit = edits;
            best = word;
        }
    }
    return best;
}

} // namespace tool
