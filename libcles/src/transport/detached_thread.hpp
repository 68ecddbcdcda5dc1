// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/system/error_code.hpp>

#include <functional>

namespace cles::transport {

/// Runs a function on a thread of its own, for which nobody waits, and which handles no signals. The function owns what
/// it uses, and must not throw. \return what the system says if it refuses the thread
boost::system::error_code start_detached(std::function<void()> function);

} // namespace cles::transport
