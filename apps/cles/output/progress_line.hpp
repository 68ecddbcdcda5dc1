// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string_view>

namespace tool {

/// Shows the progress of a task on stderr: one line that is redrawn on a terminal, a line per report elsewhere.
class progress_line {
  public:
    /// `always`: also where stderr is not a terminal.
    explicit progress_line(bool always);
    progress_line(const progress_line&) = delete;
    progress_line& operator=(const progress_line&) = delete;
    /// Erases the line.
    ~progress_line() { clear(); }

    /// Whether progress is shown at all.
    [[nodiscard]] bool is_wanted() const noexcept { return is_terminal_ || always_; }
    /// `details`: a JSON object.
    void show(double fraction, std::string_view details);
    void clear();

  private:
    bool is_terminal_;
    bool always_;
    bool drawn_ = false;
};

} // namespace tool
