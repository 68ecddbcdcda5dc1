// SPDX-License-Identifier: BSL-1.0
#include "sampler.hpp"

#include <exception>

namespace sysinfo {

sampler::~sampler() {
    {
        const std::scoped_lock lock{mutex_};
        over_ = true;
    }
    changed_.notify_all();
    if (thread_.joinable()) {
        thread_.join();
    }
}

void sampler::want(const std::string& noun) {
    const auto offered = offered_.find(noun);
    if (offered == offered_.end()) {
        return;
    }
    const std::scoped_lock lock{mutex_};
    if (!over_ && !thread_.joinable()) { // first, because the system may refuse it: then nothing is wanted yet
        thread_ = std::thread{[this] { run(); }};
    }
    if (!over_ && wanted_.emplace(noun, &offered->second).second) {
        more_wanted_ = true;
        changed_.notify_all();
    }
}

void sampler::run() {
    std::unique_lock lock{mutex_};
    while (!over_) {
        const auto next = std::chrono::steady_clock::now() + interval_;
        more_wanted_ = false;
        const auto all = wanted_;
        lock.unlock();
        for (const auto& [noun, read] : all) {
            try {
                (*read)();
            } catch (const std::exception&) { // what cannot be read is not published; a PULL returns the reason
            }
        }
        lock.lock();
        changed_.wait_until(lock, next, [this] { return over_ || more_wanted_; });
    }
}

} // namespace sysinfo
