// SPDX-License-Identifier: BSL-1.0
#include "node/publish/link_bindings.hpp"

#include <algorithm>
#include <utility>

namespace cles::core {

bool link_bindings::has(std::string_view path) noexcept {
    auto* t = source_.find(path);
    return t != nullptr && t->find(target_) != nullptr;
}

void link_bindings::bind(topic& t, binding::terms wanted) {
    if (t.find(target_) == nullptr) {
        topics_.push_back(&t);
    }
    t.bind(target_, wanted);
}

void link_bindings::release(topic& t) {
    t.unbind(target_);
    source_.release(t);
}

void link_bindings::unbind(std::string_view path) {
    auto* t = source_.find(path);
    if (t != nullptr && std::erase(topics_, t) != 0) {
        release(*t);
    }
}

void link_bindings::clear() {
    for (auto* t : std::exchange(topics_, {})) {
        release(*t);
    }
}

void link_bindings::drain(time_point now) {
    for (auto* t : topics_) {
        if (auto* b = t->find(target_)) {
            b->drain(now);
        }
    }
    const auto drained = topics_; // a publisher that continues may change the list
    for (auto* t : drained) {
        if (std::find(topics_.begin(), topics_.end(), t) != topics_.end()) {
            t->bindings().refresh();
            source_.admit(*t);
        }
    }
}

} // namespace cles::core
