// SPDX-License-Identifier: BSL-1.0
#include "doctor/checks.hpp"
#include "doctor/run_program.hpp"

#include <chrono>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

namespace tool {

using namespace std::chrono_literals;

namespace {

// Each plugin may take ten seconds.
constexpr auto check_limit = 60s;
constexpr std::string_view not_required = " (it is not required)";

std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    std::istringstream from{text};
    for (std::string line; std::getline(from, line);) {
        lines.push_back(line);
    }
    return lines;
}

} // namespace

// It looks for the file where it would look when started, and knows what may stand there.
void check_config(findings& found) {
    const auto program = find_program("clesd");
    if (program.empty()) {
        found.push_back({"config", verdict::ok, "clesd is not installed, and so there is none to check"});
        return;
    }
    try {
        const auto end = run_program({program, "--check"}, check_limit);
        auto lines = lines_of(end.text);
        // What is said before the last word is about plugins without which the daemon starts.
        while (end.code == 0 && lines.size() > 1 && lines.front().ends_with(not_required)) {
            found.push_back(
                {"config", verdict::warning, lines.front(), "mend it, or take it out of the configuration"});
            lines.erase(lines.begin());
        }
        const auto words = lines.empty() ? std::string{} : lines.front();
        if (end.code == 0) {
            found.push_back({"config", verdict::ok, "clesd: " + words});
        } else if (end.code == -1) {
            found.push_back({"config", verdict::failure, "clesd --check did not end by itself", "run " + program});
        } else {
            found.push_back({"config", verdict::failure, words.empty() ? "clesd refuses its configuration" : words,
                             "mend it, and see with clesd --check; docs/runtime.md says what may stand there"});
        }
    } catch (const std::system_error& e) {
        found.push_back({"config", verdict::failure, program + " cannot be run: " + e.code().message(),
                         "install it again, or take it out of the path"});
    }
}

} // namespace tool
