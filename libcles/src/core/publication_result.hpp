// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>

#include <boost/system/error_code.hpp>

#include <string>

namespace cles::core {

/// What came of an update whose publisher waits to hear of it.
struct publication_result {
    detail::pending_ptr operation;
    boost::system::error_code code{};
    std::string why{};

    /// Once. The publisher's handler runs in it.
    void tell() {
        if (code) {
            operation.release()->fail(code, why);
        } else {
            operation.release()->offer("{}");
        }
    }
};

} // namespace cles::core
