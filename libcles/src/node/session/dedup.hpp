// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/deadlines.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <string_view>

namespace cles::core {

/// The memory in bytes that all sources of a node share for remembered requests.
struct dedup_memory {
    std::size_t limit;
    std::size_t used = 0;
};

/// The requests of one source (an address and port) that arrived by datagram, so that a repeat is recognised: while the
/// request runs, and for a minute after its reply, which a repeat receives again.
///
/// A request is identified by its id and all its bytes, so two different requests are never confused.
class dedup final : private deadline {
  public:
    static constexpr std::chrono::seconds memory{60};
    static constexpr std::size_t cost_of_entry = 192; ///< approximate, beyond the text

    dedup(deadline_queue& deadlines, dedup_memory& shared) noexcept : deadlines_(deadlines), shared_(shared) {}
    ~dedup();

    enum class verdict : std::uint8_t {
        fresh,    ///< unknown
        running,  ///< a repeat of a running request
        answered, ///< a repeat of an answered request: `reply` returns the reply
        clash,    ///< another request with this id is running
    };
    [[nodiscard]] verdict look(std::uint64_t id, std::string_view bytes) const;
    [[nodiscard]] std::string_view reply(std::uint64_t id, std::string_view bytes) const;

    /// Records a request that must not run twice. Returns false if there is no memory for it, or for a reply of
    /// `max_reply` bytes.
    bool begin(std::uint64_t id, std::string_view bytes, std::size_t max_reply);
    /// Records a request that may run again after it has been answered.
    void add_repeatable(std::uint64_t id, std::string_view bytes);
    /// The running request with this id, if any, has been answered with `reply` (empty if no reply was wanted).
    void set_reply(std::uint64_t id, std::string_view reply, time_point now);

    /// Whether nothing is remembered.
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
    std::deque<done> done_; // in order of expiry
};

} // namespace cles::core
