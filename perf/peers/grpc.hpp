// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "driver/ordered_fan_out.hpp"
#include "driver/peer.hpp"

#include <grpcpp/grpcpp.h>

#include <cstddef>
#include <memory>
#include <string>

namespace cles::perf::peers {

/// Listens, and sets `where` to the address. \throws std::runtime_error
std::unique_ptr<::grpc::Server> start_grpc(::grpc::ServerBuilder& builder, const std::string& listen,
                                           std::string& where);
/// A connection that is not shared within this process.
std::shared_ptr<::grpc::Channel> own_channel(const std::string& where);

void serve_calls(call what, const std::string& listen, const announce& tell);
std::unique_ptr<caller> make_grpc_caller(call what, const std::string& where);

/// Streams publications to all subscribers.
class grpc_publisher {
  public:
    explicit grpc_publisher(const std::string& listen);
    grpc_publisher(const grpc_publisher&) = delete;
    grpc_publisher& operator=(const grpc_publisher&) = delete;
    ~grpc_publisher();

    [[nodiscard]] const std::string& where() const noexcept;
    /// Waits for subscribers that have not received the previous one.
    void publish(const publication& value);

  private:
    class service;
    std::unique_ptr<service> service_;
};

std::unique_ptr<subscriptions> make_grpc_subscriptions(const std::string& where, std::size_t count, inbox& into);

} // namespace cles::perf::peers
