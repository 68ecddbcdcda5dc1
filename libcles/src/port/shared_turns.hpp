// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <utility>

namespace cles::core {

/// How often something may be done: so many times at once, and so many more in each second. Both are at least 1.
struct turn_rate {
    std::uint32_t per_second = 1;
    std::uint32_t at_once = 1;
};

/// Counts turns at one rate.
class turn_bucket {
  public:
    [[nodiscard]] bool has(const turn_rate& rate, time_point now) const noexcept {
        return std::max(full_at_, now) - now <= interval(rate) * (rate.at_once - 1);
    }
    /// \pre it has one
    void take(const turn_rate& rate, time_point now) noexcept { full_at_ = std::max(full_at_, now) + interval(rate); }
    void give_back(const turn_rate& rate) noexcept { full_at_ -= interval(rate); }
    [[nodiscard]] bool is_full(time_point now) const noexcept { return full_at_ <= now; }

  private:
    static std::chrono::nanoseconds interval(const turn_rate& rate) noexcept {
        return std::chrono::nanoseconds{std::chrono::seconds{1}} / rate.per_second;
    }

    time_point full_at_{}; // then all turns are there again
};

/// Limits the work that others cause, above all those who have not proved yet who they are: of each source, and in all.
/// Sans-I/O.
///
/// Each source has a share, which the others cannot use up. What exceeds the shares comes from a part for all. So
/// sources protect each other only where nobody can make up further ones. How many are remembered is limited; those for
/// which there is no space have no share.
template <class Source>
class shared_turns {
  public:
    static constexpr std::size_t most_sources = 4096;

    struct bounds {
        turn_rate share;  ///< of each source
        turn_rate shares; ///< of all of them together
        turn_rate common; ///< beyond the shares, of all sources together
    };
    /// Where a turn came from.
    enum class turn : std::uint8_t { refused, of_share, of_common };

    explicit shared_turns(const bounds& limits) noexcept : bounds_(limits) {}

    template <class Key>
    [[nodiscard]] turn take(const Key& source, time_point now) {
        auto* const share = find_or_make(source, now);
        if (share != nullptr && share->has(bounds_.share, now) && shares_.has(bounds_.shares, now)) {
            share->take(bounds_.share, now);
            shares_.take(bounds_.shares, now);
            return turn::of_share;
        }
        if (common_.has(bounds_.common, now)) {
            common_.take(bounds_.common, now);
            return turn::of_common;
        }
        return turn::refused;
    }
    /// Who took this turn has proved who it is.
    template <class Key>
    void give_back(const Key& source, turn taken) {
        if (taken == turn::of_common) {
            common_.give_back(bounds_.common);
        } else if (taken == turn::of_share) {
            shares_.give_back(bounds_.shares);
            if (const auto found = sources_.find(source); found != sources_.end()) {
                found->second.give_back(bounds_.share);
            }
        }
    }

    [[nodiscard]] std::size_t sources() const noexcept { return sources_.size(); }

  private:
    static constexpr std::chrono::milliseconds between_searches{100};

    template <class Key>
    turn_bucket* find_or_make(const Key& source, time_point now) {
        if (const auto found = sources_.find(source); found != sources_.end()) {
            return &found->second;
        }
        if (sources_.size() >= most_sources && now >= search_again_) {
            search_again_ = now + between_searches; // so that not each of many sources costs a search
            std::erase_if(sources_, [now](const auto& each) { return each.second.is_full(now); });
        }
        return sources_.size() < most_sources ? &sources_.emplace(Source{source}, turn_bucket{}).first->second
                                              : nullptr;
    }

    const bounds bounds_;
    std::map<Source, turn_bucket, std::less<>> sources_; // those with a full share may be forgotten
    turn_bucket shares_;
    turn_bucket common_;
    time_point search_again_{};
};

} // namespace cles::core
