// SPDX-License-Identifier: BSL-1.0
#include "replay.hpp"

#include "support/conversation.hpp"

#include <algorithm>
#include <cstddef>
#include <string>

namespace cles::test {
namespace {

bool is_expectation(std::string_view line) {
    if (!line.empty() && line.front() >= 'a' && line.front() <= 'z') {
        line.remove_prefix(1);
    }
    return line.starts_with("< ") || line.starts_with("= ");
}

class comparison {
  public:
    void step(std::string_view text) {
        nothing_left();
        try {
            talk_.perform(text);
        } catch (const script_error& e) {
            problem(e.what());
        }
        came_ = talk_.take();
        at_ = 0;
    }

    void expect(std::string_view pattern) {
        if (at_ == came_.size()) {
            problem("expected '" + std::string{pattern} + "', nothing came");
        } else if (!fits(pattern, came_[at_])) {
            problem("expected '" + std::string{pattern} + "', there came '" + came_[at_] + "'");
        }
        at_ += at_ == came_.size() ? 0 : 1;
    }

    void nothing_left() {
        for (; at_ < came_.size(); ++at_) {
            problem("nobody expected '" + came_[at_] + "'");
        }
    }

    void problem(const std::string& what) { problems.push_back("line " + std::to_string(line) + ": " + what); }

    std::size_t line = 0;
    std::size_t steps = 0;
    std::vector<std::string> problems;

  private:
    conversation talk_;
    std::vector<std::string> came_;
    std::size_t at_ = 0;
};

} // namespace

bool fits(std::string_view pattern, std::string_view text) {
    constexpr std::string_view anything = "...";
    auto gap = pattern.find(anything);
    if (gap == std::string_view::npos) {
        return pattern == text;
    }
    if (!text.starts_with(pattern.substr(0, gap))) {
        return false;
    }
    text.remove_prefix(gap);
    pattern.remove_prefix(gap + anything.size());
    while ((gap = pattern.find(anything)) != std::string_view::npos) {
        const auto found = text.find(pattern.substr(0, gap));
        if (found == std::string_view::npos) {
            return false;
        }
        text.remove_prefix(found + gap);
        pattern.remove_prefix(gap + anything.size());
    }
    return text.ends_with(pattern);
}

std::vector<std::string> replay(std::string_view script) {
    comparison compared;
    while (!script.empty()) {
        const auto end = std::min(script.find('\n'), script.size());
        const auto line = script.substr(0, end);
        script.remove_prefix(end == script.size() ? end : end + 1);
        ++compared.line;
        if (line.empty() || line.starts_with('#')) {
            continue;
        }
        if (conversation::is_step(line)) {
            ++compared.steps;
            compared.step(line);
        } else if (is_expectation(line)) {
            compared.expect(line);
        } else {
            compared.problem("neither a step, nor an expectation, nor a comment");
        }
    }
    compared.nothing_left();
    if (compared.steps == 0) {
        compared.problem("nothing happens");
    }
    return compared.problems;
}

} // namespace cles::test
