// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/publisher.hpp>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>

namespace sysinfo {

/// Publishes the topics that have binders, at an interval, from a thread of its own: reading a thousand processes takes
/// milliseconds that no other thread should spend. The thread starts with the first BIND, and ends with this object.
class sampler {
  public:
    /// Reads and publishes one noun.
    using reading = std::function<void()>;

    explicit sampler(std::chrono::milliseconds interval) : interval_(interval) {}
    sampler(const sampler&) = delete;
    sampler& operator=(const sampler&) = delete;
    ~sampler();

    /// What may be wanted. Before the first `want`.
    void offer(std::string noun, reading read) { offered_.emplace(std::move(noun), std::move(read)); }
    /// From now on the noun is published, at once the first time. Quick, from any thread. \throws std::system_error if
    /// the system refuses the thread
    void want(const std::string& noun);

  private:
    void run();

    const std::chrono::milliseconds interval_;
    std::map<std::string, reading> offered_;
    std::mutex mutex_; // guards what follows
    std::condition_variable changed_;
    std::map<std::string, const reading*> wanted_;
    bool more_wanted_ = false;
    bool over_ = false;
    std::thread thread_;
};

} // namespace sysinfo
