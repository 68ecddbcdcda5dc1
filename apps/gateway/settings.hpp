// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>
#include <cles/service.hpp>

#include "gateway/access/origin.hpp"
#include "gateway/arguments.hpp"

#include <boost/asio/ip/tcp.hpp>

#include <vector>

namespace gateway {

/// What the options mean for HTTP.
struct http_settings {
    std::vector<boost::asio::ip::tcp::endpoint> endpoints{};
    origin_rules origins{};
    bool needs_token = false;
};
/// \throws tool::usage_error if options are not valid, or would let others use the network without a token or TLS
http_settings http_settings_of(const tool::gateway_arguments& given);

/// What they mean for the node. \throws tool::usage_error, or std::runtime_error if the key cannot be used
cles::service_options node_options_of(const tool::gateway_arguments& given, const cles::log_sink& log);

} // namespace gateway
