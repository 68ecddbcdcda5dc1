// SPDX-License-Identifier: BSL-1.0
#include "streams.hpp"

namespace fmv {

std::shared_ptr<kept_stream> streams::find(const std::string& name, time_point now) {
    const std::scoped_lock guard{lock_};
    std::erase_if(all_, [&](const auto& one) { return now - one.second.used > idle_; });
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
        if (all_.size() >= most_) {
            return nullptr;
        }
        at = all_.emplace(name, entry{.what = std::make_shared<kept_stream>(size), .used = now}).first;
    }
    return at->second.what;
}

std::size_t streams::count() const {
    const std::scoped_lock guard{lock_};
    return all_.size();
}

} // namespace fmv
