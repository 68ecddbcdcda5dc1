// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/memory_budget.hpp"

#include <cstddef>
#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// Requests without id that came while another was being served, in their order. What they take counts for an account.
class waiting_requests {
  public:
    explicit waiting_requests(std::shared_ptr<memory_account> memory = nullptr) noexcept : held_(std::move(memory)) {}

    /// Either a line that is still to be served, or an answer that is known already and stands as many times in a row.
    struct entry {
        std::string line;
        std::string answer;
        time_point arrived;
        std::size_t times = 1;
    };

    /// False where there is no memory for it, unless it has to be taken all the same.
    bool push_line(std::string_view line, time_point arrived, bool always = false) {
        if (!always && !held_.try_resize(bytes_ + line.size())) {
            return false;
        }
        grow(line.size());
        entries_.push_back({.line = std::string{line}, .answer = {}, .arrived = arrived});
        return true;
    }
    /// Equal answers in a row take no more memory than one, but count as what they are: they will be written.
    void push_answer(std::string answer, time_point arrived) {
        grow(answer.size());
        if (!entries_.empty() && entries_.back().line.empty() && entries_.back().answer == answer) {
            ++entries_.back().times;
            return;
        }
        entries_.push_back({.line = {}, .answer = std::move(answer), .arrived = arrived});
    }
    entry pop() {
        auto first = std::move(entries_.front());
        entries_.pop_front();
        bytes_ -= first.line.size() + first.answer.size() * first.times;
        held_.resize(bytes_);
        return first;
    }
    void clear() noexcept {
        entries_.clear();
        bytes_ = 0;
        held_.resize(0);
    }

    [[nodiscard]] bool empty() const noexcept { return entries_.empty(); }
    [[nodiscard]] std::size_t size() const noexcept { return entries_.size(); }
    [[nodiscard]] std::size_t bytes() const noexcept { return bytes_; }

  private:
    void grow(std::size_t by) noexcept {
        bytes_ += by;
        held_.resize(bytes_);
    }

    std::deque<entry> entries_;
    std::size_t bytes_ = 0;
    memory_reservation held_;
};

} // namespace cles::core
