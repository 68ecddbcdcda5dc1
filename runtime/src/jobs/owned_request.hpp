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

/// Copies of the requesters' identities. All jobs of one requester share a copy, which may outlive the link.
class identity_cache {
  public:
    [[nodiscard]] std::shared_ptr<const identity> copy_of(const identity& peer);

  private:
    static constexpr std::size_t max_copies = 1024;
    boost::unordered_flat_map<const identity*, std::shared_ptr<const identity>> copies_;
};

/// A copy of a request, in memory that is reused for the next one.
class owned_request {
  public:
    owned_request() = default;
    owned_request(const owned_request&) = delete;
    owned_request& operator=(const owned_request&) = delete;

    /// \param peer a copy of the identity of the request's peer
    void assign(const request& what, std::shared_ptr<const identity> peer);
    /// Frees the memory of a large request, so that it is not held for ever.
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
