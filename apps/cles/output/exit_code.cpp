// SPDX-License-Identifier: BSL-1.0
#include "output/exit_code.hpp"

namespace tool::exit_code {

int of(const cles::error& failure) {
    if (failure.code().category() != cles::error_category()) {
        return local_failure; // the system's word: no link came about, or nothing can listen there
    }
    switch (static_cast<cles::errc>(failure.code().value())) {
    case cles::errc::no_target:
    case cles::errc::no_task: return not_found;
    case cles::errc::deadline: return deadline;
    case cles::errc::busy: return busy;
    case cles::errc::unavailable:
    case cles::errc::bad_request:
    case cles::errc::denied:
    case cles::errc::too_large:
    case cles::errc::cancelled:
    case cles::errc::failed:
    case cles::errc::conversion: return remote_error;
    case cles::errc::invalid_url:
    case cles::errc::unknown_scheme:
    case cles::errc::insecure_listen:
    case cles::errc::invalid_name:
    case cles::errc::invalid_option: return usage;
    case cles::errc::would_deadlock:
    case cles::errc::already_registered:
    case cles::errc::stopped:
    case cles::errc::closed: return local_failure;
    }
    return remote_error;
}

} // namespace tool::exit_code
