// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace tool {

/// What the completion of a shell runs, as `cles __complete WORD...`: the words after "cles" up to the cursor, the last
/// of them being typed, and maybe empty. Prints what may stand in its place, a line each: the word, and behind a tab a
/// few words about it. It takes less than 100 ms, prints nothing else, and never fails.
int complete(CLI::App& app, std::vector<std::string> words);

} // namespace tool
