// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "support/session_fixture.hpp"
#include "support/told.hpp"

#include <cstddef>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace cles::test {

/// A step that is not valid in a script.
class script_error : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// A node without a network that runs a script, one line per step (test/golden/README.md). The results of a step are
/// reported in the script's own syntax, so that they can be compared with what the script expects.
class conversation {
  public:
    conversation();
    conversation(const conversation&) = delete;
    conversation& operator=(const conversation&) = delete;
    ~conversation();

    /// Whether a line of a script is a step, not a comment or an expectation.
    static bool is_step(std::string_view line);
    /// \throws script_error
    void perform(std::string_view step);
    /// The results since the last call, in order: "< {...}", "= finish", "b< {...}".
    std::vector<std::string> take();

    /// The limits that `@ limits` sets; change them only before the first other step.
    cles::limits bounds{};
    [[nodiscard]] test_node* node() noexcept { return node_.get(); }
    [[nodiscard]] std::map<char, std::unique_ptr<test_link>>& links() noexcept { return links_; }

  private:
    void make_node();
    void add_quick_tasks();
    void add_later_tasks();
    test_link& link(char name);
    void happen(char name, std::string_view what);
    void on_link(char name, std::string_view what, std::string_view rest);
    void on_handler(std::string_view what, std::string_view rest);
    void set_limit(std::string_view assignment);
    void ask(char name, std::string_view rest);
    void follow(char name, std::string_view rest);
    void collect();
    void collect_states();

    struct seen {
        int finishes = 0;
        int closes = 0;
        bool paused = false;
    };

    std::vector<std::string> told_;
    std::map<std::uint64_t, told_reply::state> asked_;
    std::unique_ptr<test_node> node_;
    std::vector<std::unique_ptr<told_feed>> feeds_;
    std::map<char, std::unique_ptr<test_link>> links_;
    std::map<char, seen> seen_;
};

} // namespace cles::test
