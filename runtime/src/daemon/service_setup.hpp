// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>
#include <cles/service.hpp>

namespace cles::runtime {

struct config;

/// The options of the daemon's service, without those that refer to the daemon itself. \throws config_error if a file
/// that they need cannot be used
service_options options_of(const config& setup, log_sink log);

} // namespace cles::runtime
