// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "port/group_source.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

namespace cles::core {

class presence;

/// From which sources a publisher's updates by the multicast group are taken: those of the run whose name it is (one
/// for each of its interfaces; that the others are its own too, each of its announcements says). One that announces
/// nothing is tied to the source that it was first heard from, until that falls silent. Another that sends updates
/// under the name cannot silence it. Sources of other pools are not heard at all.
class publisher_sources {
  public:
    static constexpr std::chrono::milliseconds silent_after{3'500};

    publisher_sources(const presence& others, std::size_t most) noexcept : others_(others), most_(most) {}

    enum class verdict : std::uint8_t {
        refused,
        taken,
        one_of_several, ///< taken, and the same may come from another of its sources
        another,        ///< taken, from another source than before: what was known of the order says nothing of it
    };
    /// Whether an update of that node counts that has come from there; then it keeps the tie alive.
    verdict look(std::string_view node, const group_source& from, time_point now);
    /// The source is of another pool, for so long.
    void note_foreign(const group_source& from, time_point until);
    [[nodiscard]] bool is_foreign(const group_source& from, time_point now) const noexcept {
        const auto found = foreign_.find(from);
        return found != foreign_.end() && found->second > now;
    }
    [[nodiscard]] std::size_t size() const noexcept { return ties_.size(); }

  private:
    struct tie {
        group_source to;
        time_point heard{};
    };

    const presence& others_;
    std::size_t most_;
    std::map<std::string, tie, std::less<>> ties_; // of those that announce nothing
    boost::unordered_flat_map<group_source, time_point> foreign_;
};

} // namespace cles::core
