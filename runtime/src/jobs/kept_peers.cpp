// SPDX-License-Identifier: BSL-1.0
#include "jobs/kept_peers.hpp"

namespace cles::runtime {
namespace {

bool is_same(const identity& a, const identity& b) {
    return a.address == b.address && a.transport == b.transport && a.name == b.name && a.uid == b.uid &&
           a.local == b.local;
}

} // namespace

std::shared_ptr<const identity> kept_peers::copy_of(const identity& peer) {
    if (all_.size() > most) {
        all_.clear();
    }
    auto& kept = all_[&peer];
    if (!kept || !is_same(*kept, peer)) { // another link may be where one was
        kept = std::make_shared<identity>(peer);
    }
    return kept;
}

} // namespace cles::runtime
