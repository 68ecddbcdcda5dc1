// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstddef>
#include <memory>

namespace cles::runtime {

/// Copies of the requesters' identities. All jobs of one requester share a copy, which may outlive the link.
class identity_cache {
  public:
    [[nodiscard]] std::shared_ptr<const identity> copy_of(const identity& peer);

  private:
    static constexpr std::size_t max_copies = 1024;
    boost::unordered_flat_map<const identity*, std::shared_ptr<const identity>> copies_;
};

} // namespace cles::runtime
