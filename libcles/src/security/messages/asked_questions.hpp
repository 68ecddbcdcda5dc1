// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/datagrams/rate_limit.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>

namespace cles::security {

/// What this node has asked others: once a second about each subject at most, and so many times a second in all. An
/// answer counts for ten seconds, once. So at most ten seconds' worth of questions are remembered.
template <class Subject, class Question>
class asked_questions {
  public:
    static constexpr std::chrono::seconds between_questions{1};
    static constexpr std::chrono::seconds answered_within{10};

    explicit asked_questions(std::uint32_t per_second) : all_{per_second} {}

    /// Whether one may be asked about this now; if so, it counts, and `note` follows.
    [[nodiscard]] bool take_turn(const Subject& about, time_point now) {
        forget(now);
        const bool too_soon = std::ranges::any_of(
            asked_, [&](const entry& q) { return q.about == about && now - q.at < between_questions; });
        return !too_soon && all_.take(now);
    }
    void note(Subject about, Question asked, time_point now) {
        asked_.push_back({.about = std::move(about), .asked = std::move(asked), .at = now});
    }
    /// Whether one about this is open.
    [[nodiscard]] bool is_open(const Subject& about, time_point now) {
        forget(now);
        return std::ranges::find(asked_, about, &entry::about) != asked_.end();
    }
    /// Calls `change` with each open question about this. Returns whether there are any.
    template <class Change>
    bool change_open(const Subject& about, time_point now, Change change) {
        forget(now);
        bool any = false;
        for (auto& q : asked_) {
            if (q.about == about) {
                change(q.asked);
                any = true;
            }
        }
        return any;
    }
    /// Takes the question about this that is answered, for which the condition holds; the others about it end.
    template <class Condition>
    [[nodiscard]] std::optional<Question> take(const Subject& about, time_point now, Condition is_answered) {
        forget(now);
        const auto found =
            std::ranges::find_if(asked_, [&](const entry& q) { return q.about == about && is_answered(q.asked); });
        if (found == asked_.end()) {
            return {};
        }
        auto taken = std::optional{std::move(found->asked)};
        end(about);
        return taken;
    }
    /// No answer about this counts any more.
    void end(const Subject& about) {
        end_if([&about](const Subject& of) { return of == about; });
    }
    template <class Condition>
    void end_if(Condition concerns) {
        std::erase_if(asked_, [&concerns](const entry& q) { return concerns(q.about); });
    }

  private:
    struct entry {
        Subject about;
        Question asked;
        time_point at;
    };

    void forget(time_point now) {
        while (!asked_.empty() && now - asked_.front().at > answered_within) {
            asked_.pop_front();
        }
    }

    rate_limit all_;
    std::deque<entry> asked_; // the oldest is first
};

} // namespace cles::security
