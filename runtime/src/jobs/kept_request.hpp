// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/request.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::runtime {

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
