// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <ostream>
#include <string>
#include <vector>

namespace cles::test {

/// A recorded conversation.
struct transcript {
    std::string name;
    std::string text;
};

inline std::ostream& operator<<(std::ostream& to, const transcript& t) { return to << t.name; }

/// All that are recorded, in the order of their names. Tests run in the project's folder.
inline std::vector<transcript> transcripts() {
    std::vector<transcript> all;
    for (const auto& entry : std::filesystem::directory_iterator{"test/golden"}) {
        if (entry.path().extension() == ".txt") {
            std::ifstream file{entry.path(), std::ios::binary};
            all.push_back({entry.path().filename().string(), {std::istreambuf_iterator<char>{file}, {}}});
        }
    }
    std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
    return all;
}

} // namespace cles::test
