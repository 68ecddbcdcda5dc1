// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "peer.hpp"

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>

namespace cles::perf::peers {

/// Listens, and says where. \throws std::runtime_error
std::unique_ptr<::grpc::Server> start_grpc(::grpc::ServerBuilder& builder, const std::string& listen,
                                           std::string& where);
/// A connection that nobody else in this process shares.
std::shared_ptr<::grpc::Channel> own_channel(const std::string& where);

void serve_calls(call what, const std::string& listen, const announce& tell);
std::unique_ptr<caller> make_grpc_caller(call what, const std::string& where);

} // namespace cles::perf::peers
