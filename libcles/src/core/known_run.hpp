// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/announcement.hpp"
#include "core/teller.hpp"
#include "port/group_source.hpp"

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::core {

/// Something that is said of a run of a node. It borrows what it refers to.
struct word {
    const announcement& said;
    std::uint32_t epoch;
    std::uint64_t seq; ///< 0: nobody said
    time_point spoken; ///< by the node itself
    group_source from; ///< nothing but zeros: it was told by another
    const teller& by;

    [[nodiscard]] bool told() const noexcept { return from == group_source{}; }
};

/// A node from one start to the next, as far as it is known.
struct known_run {
    std::uint32_t epoch = 0;
    group_source from;     ///< by which it is asked; nothing but zeros: only others have told of it
    std::uint64_t seq = 0; ///< 0: never told
    time_point heard{};
    time_point heard_there{};     ///< from `from`
    std::uint64_t news = 0;       ///< the number of the last thing that was heard of it
    std::uint64_t described = 0;  ///< and of the last that was more than that it lives
    std::uint32_t service_us = 0; ///< how long work took there then
    announcement said{};
    std::vector<std::string> endpoints; ///< as they can be used here
    std::vector<std::string> passed_on; ///< as they are told to others

    /// The first that is heard of it; takes the next of the `numbers` of news.
    static known_run first(const word& w, std::uint64_t& numbers);
    /// Takes what is newer.
    void take(const word& w, std::uint64_t& numbers);
    /// Whether that load is more than a beat tells.
    [[nodiscard]] bool is_another_choice(const node_load& now) const noexcept;
    /// Takes where it can be asked. Whether it could not be asked there before.
    bool place(const word& w);
    /// Takes, of what has been taken already, that it came by another interface or by the same once more. Whether it
    /// is asked elsewhere now.
    bool hear_again(const word& w);

    [[nodiscard]] bool is(std::uint32_t e, const group_source& f) const noexcept {
        return epoch == e && (from == group_source{} || f == group_source{} || sends_from(f));
    }
    /// Whether it is its source in the group, or one of those that it has announced to be.
    [[nodiscard]] bool sends_from(const group_source& f) const noexcept {
        return from == f || std::find(said.sources.begin(), said.sources.end(), f) != said.sources.end();
    }
    /// Whether that has come before, by another of several interfaces.
    [[nodiscard]] bool is_repeated_by(const word& w) const noexcept {
        return !w.told() && !said.sources.empty() && w.seq == seq;
    }
    /// Whether what was said is newer than all that is known of it.
    [[nodiscard]] bool is_older_than(std::uint64_t s, time_point spoken) const noexcept {
        return seq != 0 && s != 0 ? s > seq : spoken >= (s != 0 ? heard : heard + said.interval / 2);
    }
    [[nodiscard]] std::string_view where() const noexcept {
        return endpoints.empty() ? std::string_view{} : std::string_view{endpoints.front()};
    }

  private:
    [[nodiscard]] bool is_asked_better_by(const word& w) const noexcept;
};

} // namespace cles::core
