// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstddef>
#include <memory>

namespace cles::runtime {

/// Copies of the identities of those who ask, which all jobs of one share: a job may outlive the link that it came by.
class kept_peers {
  public:
    [[nodiscard]] std::shared_ptr<const identity> copy_of(const identity& peer);

  private:
    static constexpr std::size_t most = 1024;
    boost::unordered_flat_map<const identity*, std::shared_ptr<const identity>> all_;
};

} // namespace cles::runtime
