// SPDX-License-Identifier: BSL-1.0
#include <cles/call_options.hpp>

#include <utility>

namespace cles {

// Not in the header: there, g++ 12 may inline it into a coroutine together with a copy of the options, and then warns
// that an empty lambda in them is not initialised.
call_options& call_options::on_progress(std::function<void(double, std::string_view)> callback) {
    on_progress_ = std::move(callback);
    return *this;
}

} // namespace cles
