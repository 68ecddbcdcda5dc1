// SPDX-License-Identifier: BSL-1.0
#include "doctor_checks.hpp"
#include "run_program.hpp"

#include <chrono>
#include <string>
#include <system_error>

namespace tool {

using namespace std::chrono_literals;

namespace {

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

} // namespace

// It looks for the file where it would look when started, and knows what may stand there.
void check_config(findings& found) {
    const auto program = find_program("clesd");
    if (program.empty()) {
        found.push_back({"config", verdict::ok, "clesd is not installed, and so there is none to check"});
        return;
    }
    try {
        const auto end = run_program({program, "--check"}, 10s);
        const auto words = first_line(end.text);
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
