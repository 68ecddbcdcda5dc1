// SPDX-License-Identifier: BSL-1.0
#include "jobs/identity_cache.hpp"

namespace cles::runtime {
namespace {

bool is_same(const identity& a, const identity& b) {
    return a.address == b.address && a.transport == b.transport && a.name == b.name && a.uid == b.uid &&
           a.local == b.local;
}

} // namespace

std::shared_ptr<const identity> identity_cache::copy_of(const identity& peer) {
    if (copies_.size() > max_copies) {
        copies_.clear();
    }
    auto& copy = copies_[&peer];
    if (!copy || !is_same(*copy, peer)) { // another link may be at the address of an earlier one
        copy = std::make_shared<identity>(peer);
    }
    return copy;
}

} // namespace cles::runtime
