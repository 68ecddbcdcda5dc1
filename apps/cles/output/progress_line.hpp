// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string_view>

namespace tool {

/// Shows on stderr how far a task is: one line that is drawn anew on a terminal, a line per report elsewhere.
class progress_line {
  public:
    /// `always`: also where stderr is no terminal.
    explicit progress_line(bool always);
    progress_line(const progress_line&) = delete;
    progress_line& operator=(const progress_line&) = delete;
    /// Wipes the line.
    ~progress_line() { clear(); }

    /// Whether anybody would see it.
    [[nodiscard]] bool is_wanted() const noexcept { return redraws_ || always_; }
    /// `details`: a JSON object.
    void show(double fraction, std::string_view details);
    void clear();

  private:
    bool redraws_;
    bool always_;
    bool drawn_ = false;
};

} // namespace tool
