// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include <memory>
#include <string>

namespace cles::transport {

/// `inproc://name`: services of one process, each on an executor of its own or all on one.
std::unique_ptr<link_transport> make_inproc();

/// Whether a service of this process listens there.
bool is_open(const std::string& name);

} // namespace cles::transport
