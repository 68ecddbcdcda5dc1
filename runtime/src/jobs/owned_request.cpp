// SPDX-License-Identifier: BSL-1.0
#include "jobs/owned_request.hpp"

#include <utility>

namespace cles::runtime {
namespace {

constexpr std::size_t max_retained = 16384; // bytes of memory that a record keeps

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

void owned_request::assign(const request& what, std::shared_ptr<const identity> peer) {
    auto size = what.node().size() + what.task().size() + what.body().size();
    for (const auto p : what.parameters()) {
        size += p.size();
    }
    text_.clear();
    text_.reserve(size); // views refer to it
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

void owned_request::clear() {
    peer_.reset();
    data_ = {};
    if (text_.capacity() > max_retained) {
        text_ = {};
    }
}

} // namespace cles::runtime
