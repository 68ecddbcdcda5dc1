// SPDX-License-Identifier: BSL-1.0
#include "jobs/owned_request.hpp"

#include <utility>

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

namespace {

constexpr std::size_t roomy = 16384;

} // namespace

void kept_request::keep(const request& what, std::shared_ptr<const identity> peer) {
    auto size = what.node().size() + what.task().size() + what.body().size();
    for (const auto p : what.parameters()) {
        size += p.size();
    }
    text_.clear();
    text_.reserve(size); // the views must stay
    const auto copy = [this](std::string_view part) {
        const auto at = text_.size();
        text_.append(part);
        return std::string_view{text_}.substr(at);
    };
    peer_ = std::move(peer);
    data_.verb = what.verb();
    data_.node = copy(what.node());
    data_.task = copy(what.task());
    data_.body = copy(what.body());
    parameters_.clear();
    for (const auto p : what.parameters()) {
        parameters_.push_back(copy(p));
    }
    data_.parameters = parameters_;
    data_.peer = peer_.get();
    data_.deadline = what.deadline();
}

void kept_request::clear() {
    peer_.reset();
    data_ = {};
    if (text_.capacity() > roomy) {
        text_ = {};
    }
}

} // namespace cles::runtime
