// SPDX-License-Identifier: BSL-1.0
#include "streams.hpp"

#include <algorithm>

namespace fmv {

std::shared_ptr<kept_stream> streams::find(const std::string& name, time_point now) {
    const std::scoped_lock guard{lock_};
    forget_idle(now);
    const auto at = all_.find(name);
    if (at == all_.end()) {
        return nullptr;
    }
    at->second.used = now;
    return at->second.what;
}

std::shared_ptr<kept_stream> streams::begin(const std::string& name, extent size, time_point now) {
    const std::scoped_lock guard{lock_};
    auto at = all_.find(name);
    if (at == all_.end()) {
        if (count_all() >= most_) {
            return nullptr;
        }
        at = all_.emplace(name, entry{.what = std::make_shared<kept_stream>(size), .used = now}).first;
    }
    return at->second.what;
}

std::shared_ptr<kept_stream> streams::open(extent size, time_point now) {
    const std::scoped_lock guard{lock_};
    forget_idle(now);
    if (count_all() >= most_) {
        return nullptr;
    }
    auto made = std::make_shared<kept_stream>(size);
    open_.push_back(made);
    return made;
}

std::size_t streams::count() const {
    const std::scoped_lock guard{lock_};
    return count_all();
}

// With the lock, as below.
void streams::forget_idle(time_point now) {
    std::erase_if(all_, [&](const auto& one) { return now - one.second.used > idle_; });
    std::erase_if(open_, [](const auto& one) { return one.expired(); });
}

std::size_t streams::count_all() const {
    const auto open = std::count_if(open_.begin(), open_.end(), [](const auto& one) { return !one.expired(); });
    return all_.size() + static_cast<std::size_t>(open);
}

} // namespace fmv
