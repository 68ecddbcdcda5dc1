// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "ordered_fan_out.hpp"

#include <cstddef>
#include <memory>
#include <string>

namespace cles::perf::peers {

/// Streams what is published to whoever has called.
class grpc_publisher {
  public:
    explicit grpc_publisher(const std::string& listen);
    grpc_publisher(const grpc_publisher&) = delete;
    grpc_publisher& operator=(const grpc_publisher&) = delete;
    ~grpc_publisher();

    [[nodiscard]] const std::string& where() const noexcept;
    /// Waits for a subscriber that has not taken what came before.
    void publish(const publication& value);

  private:
    class service;
    std::unique_ptr<service> service_;
};

std::unique_ptr<subscriptions> make_grpc_subscriptions(const std::string& where, std::size_t count, inbox& into);

} // namespace cles::perf::peers
