// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/request.hpp>

#include <boost/unordered/unordered_flat_map.hpp>

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::runtime {

/// Copies of the identities of those who ask, which all jobs of one share: a job may outlive the link that it came by.
class kept_peers {
  public:
    [[nodiscard]] std::shared_ptr<const identity> copy_of(const identity& peer);

  private:
    static constexpr std::size_t most = 1024;
    boost::unordered_flat_map<const identity*, std::shared_ptr<const identity>> all_;
};

/// A request's own copy in memory that is used again for the next one.
class kept_request {
  public:
    kept_request() = default;
    kept_request(const kept_request&) = delete;
    kept_request& operator=(const kept_request&) = delete;

    /// `peer` is the request's own, in memory that stays.
    void keep(const request& what, std::shared_ptr<const identity> peer);
    /// Forgets what is large, so that one big request does not fill memory for good.
    void clear();
    [[nodiscard]] const request& get() const noexcept { return request_; }

  private:
    std::string text_;
    std::vector<std::string_view> parameters_;
    std::shared_ptr<const identity> peer_;
    detail::request_data data_;
    request request_{data_};
};

} // namespace cles::runtime
