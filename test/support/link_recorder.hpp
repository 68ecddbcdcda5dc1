// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace cles::test {

/// An owner of a link that records its calls.
class link_recorder final : public link_events {
  public:
    // A letter per call, in order: (l)ine, (b)atch, (o)verlong, (e)nd, lo(x)st, w(r)itable.
    std::string calls{};
    std::vector<std::string> lines{};
    std::string head{};
    std::string rest{}; ///< of a line that was cut off
    boost::system::error_code why{};
    /// Called on each call, with its letter.
    std::function<void(char)> hook{};

    [[nodiscard]] std::size_t count(char call) const {
        return static_cast<std::size_t>(std::count(calls.begin(), calls.end(), call));
    }
    [[nodiscard]] bool has(char call) const { return calls.find(call) != std::string::npos; }
    [[nodiscard]] bool lost() const { return has('x'); }
    [[nodiscard]] bool over() const { return has('e') || lost(); }

    /// Whether the calls had the order that `link_events` guarantees.
    [[nodiscard]] bool in_order() const {
        const auto last_word = calls.find_first_of("oe");
        const auto lines_end = calls.rfind('l');
        const auto loss = calls.find('x');
        return count('o') + count('e') <= 1 && count('x') <= 1 &&
               (last_word == std::string::npos || lines_end == std::string::npos || lines_end < last_word) &&
               (loss == std::string::npos || loss + 1 == calls.size());
    }

    void on_line(std::string_view line) override {
        lines.emplace_back(line);
        note('l');
    }
    void on_overlong(std::string_view start) override {
        head = start;
        note('o');
    }
    void on_cut(std::string_view what) override { rest = what; }
    void on_batch() override { note('b'); }
    void on_end() override { note('e'); }
    void on_lost(boost::system::error_code code) override {
        why = code;
        note('x');
    }
    void on_writable() override { note('r'); }

  private:
    void note(char call) {
        calls.push_back(call);
        if (hook) {
            hook(call);
        }
    }
};

} // namespace cles::test
