// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>
#include <cles/job_feed.hpp>

#include "plugins/plugin_jobs.hpp"

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstddef>
#include <cstdint>
#include <mutex>

namespace cles::runtime {

/// The feeds of a plugin's jobs, by their handles: numbers that are not used again, so an invalid one does no harm. All
/// functions may be called from any thread.
class plugin_feeds {
  public:
    using id = std::uint64_t;

    static constexpr std::size_t max_open = 4096;

    /// A feed, or why it cannot be read.
    struct entry {
        job_feed feed{};
        plugin_jobs::id job = 0; ///< 0: it is not known any more
        errc why = errc::cancelled;
        const char* words = "the feed is closed";
    };

    /// A handle, never 0. If there are too many, that of a feed that has ended.
    id add(entry what);
    /// The feed; an entry without one if there is none.
    [[nodiscard]] entry find(id feed) const;
    /// Whether there has ever been one with that handle.
    [[nodiscard]] bool has_existed(id feed) const;
    /// Forgets a feed, which unbinds it.
    void remove(id feed);

  private:
    mutable std::mutex mutex_;
    boost::unordered_flat_map<id, entry> all_;
    id last_ = 0;
};

} // namespace cles::runtime
