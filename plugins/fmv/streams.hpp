// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "stream.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace fmv {

/// A stream, and how far it is. It is used under its lock.
struct kept_stream {
    explicit kept_stream(extent size) : video(size) {}

    std::mutex lock;
    stream video;
    std::uint64_t next = 0; ///< the frame that would follow
};

/// The streams that are being worked on: so many at most. Those with a name are forgotten when they have been idle for
/// long; the others belong to jobs, and end with them. Thread-safe; time is the caller's.
class streams {
  public:
    using time_point = std::chrono::steady_clock::time_point;

    streams(std::size_t most, std::chrono::milliseconds idle) : most_(most), idle_(idle) {}

    /// The stream of that name; null, if there is none.
    std::shared_ptr<kept_stream> find(const std::string& name, time_point now);
    /// A new stream, or the one that another thread has begun meanwhile; null, if there are too many.
    std::shared_ptr<kept_stream> begin(const std::string& name, extent size, time_point now);
    /// A new stream of a job; null, if there are too many.
    std::shared_ptr<kept_stream> open(extent size, time_point now);
    [[nodiscard]] std::size_t count() const;
    [[nodiscard]] std::size_t most() const noexcept { return most_; }

  private:
    struct entry {
        std::shared_ptr<kept_stream> what;
        time_point used;
    };

    void forget_idle(time_point now);
    [[nodiscard]] std::size_t count_all() const;

    std::size_t most_;
    std::chrono::milliseconds idle_;
    mutable std::mutex lock_;
    std::map<std::string, entry> all_;
    std::vector<std::weak_ptr<kept_stream>> open_; ///< of jobs, which may have ended
};

} // namespace fmv
