// SPDX-License-Identifier: BSL-1.0
#include <cles/job_feed.hpp>

namespace cles {

// In a plugin: there is no service in its library, and the host binds.

job_feed responder::bind(std::string_view noun, const bind_options& options) const {
    return job_feed{call_->bind(nullptr, noun, options)};
}

job_feed responder::bind(std::string_view noun) const { return bind(noun, {}); }

} // namespace cles
