// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>
#include <cles/request.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

/// Copies of requests. Not for applications.

namespace cles::detail {

/// A copy of a request. Its memory is reused for the next request that is assigned.
class owned_request {
  public:
    owned_request() = default;
    owned_request(const owned_request&) = delete;
    owned_request& operator=(const owned_request&) = delete;

    /// \param peer a copy of the identity of the request's peer
    void assign(const request& what, std::shared_ptr<const identity> peer);
    /// Releases the peer, and the memory of a large request.
    void clear();
    /// Always the same object, for a `request` that refers to it.
    [[nodiscard]] const request_data& data() const noexcept { return data_; }

  private:
    std::string text_; // all that the views refer to
    std::vector<std::string_view> parameters_;
    std::shared_ptr<const identity> peer_;
    request_data data_;
};

} // namespace cles::detail
