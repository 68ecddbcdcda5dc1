// SPDX-License-Identifier: BSL-1.0
#include "plugins/plugin_feeds.hpp"

#include <utility>

namespace cles::runtime {

plugin_feeds::id plugin_feeds::add(entry what) {
    const std::scoped_lock lock{mutex_};
    ++last_;
    if (all_.size() < max_open) {
        all_.emplace(last_, std::move(what));
    }
    return last_;
}

plugin_feeds::entry plugin_feeds::find(id feed) const {
    const std::scoped_lock lock{mutex_};
    const auto found = all_.find(feed);
    return found == all_.end() ? entry{} : found->second;
}

bool plugin_feeds::has_existed(id feed) const {
    const std::scoped_lock lock{mutex_};
    return feed != 0 && feed <= last_;
}

void plugin_feeds::remove(id feed) {
    entry gone; // destroyed without the lock
    const std::scoped_lock lock{mutex_};
    if (const auto found = all_.find(feed); found != all_.end()) {
        gone = std::move(found->second);
        all_.erase(found);
    }
}

} // namespace cles::runtime
