// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "core/deadlines.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>

namespace cles::core {

/// What all sources of a node may have remembered together.
struct dedup_memory {
    std::size_t limit;
    std::size_t used = 0;
};

/// The requests of one source (an address and port) that came by datagram, so that a repeat is known for one: while
/// they run, and for a minute after their reply, which a repeat gets once more.
///
/// A request is its id and its bytes. Both are kept whole: no two requests are ever taken for one another.
class dedup final : private deadline {
  public:
    static constexpr std::chrono::seconds memory{60};
    static constexpr std::size_t cost_of_entry = 192; ///< beyond the text, about

    dedup(deadline_queue& deadlines, dedup_memory& shared) noexcept : deadlines_(deadlines), shared_(shared) {}
    ~dedup();

    enum class verdict : std::uint8_t {
        fresh,    ///< not known
        running,  ///< a repeat of one that runs
        answered, ///< a repeat of one that has been answered: `reply` has the answer
        clash,    ///< another one with this id runs
    };
    [[nodiscard]] verdict look(std::uint64_t id, std::string_view bytes) const;
    [[nodiscard]] std::string_view reply(std::uint64_t id, std::string_view bytes) const;

    /// Takes note of a request that is at most run once. False: there is no memory left for it, or for a reply of
    /// `longest_reply` bytes.
    bool begin(std::uint64_t id, std::string_view bytes, std::size_t longest_reply);
    /// Takes note of a request that may be run again once it has been answered.
    void begin_repeatable(std::uint64_t id, std::string_view bytes);
    /// The request of this id that runs, if there is one, has been answered with this (with nothing, where no reply was
    /// wanted).
    void answered(std::uint64_t id, std::string_view reply, time_point now);

    /// Nothing is remembered.
    [[nodiscard]] bool empty() const noexcept { return entries_.empty(); }

  private:
    struct entry {
        std::string text; // the request, followed by its reply
        std::size_t request = 0;
        std::size_t cost = 0;
        bool running = true;
        bool once = true;

        [[nodiscard]] std::string_view bytes() const noexcept { return std::string_view{text}.substr(0, request); }
    };
    using entries = std::multimap<std::uint64_t, entry>;
    struct done {
        entries::iterator which;
        time_point until;
    };

    [[nodiscard]] const entry* find(std::uint64_t id, std::string_view bytes) const;
    void enter(std::uint64_t id, std::string_view bytes, bool once, std::size_t cost);
    void charge(entry& e, std::size_t cost) noexcept;
    void forget(entries::iterator which) noexcept;
    void on_deadline(time_point now) override;

    deadline_queue& deadlines_;
    dedup_memory& shared_;
    entries entries_;
    std::deque<done> done_; // in the order of their end
};

} // namespace cles::core
