// SPDX-License-Identifier: BSL-1.0
// The part of a program that uses Asio's functions from the library.
#include "separate_part.hpp"

#include <boost/asio/error.hpp>

#if !defined(BOOST_ASIO_SEPARATE_COMPILATION)
#error cles::cles defines BOOST_ASIO_SEPARATE_COMPILATION by default
#endif

const boost::system::error_category& category_in_separate_part() { return boost::asio::error::get_netdb_category(); }

void await_signal(boost::asio::signal_set& signals, int number, std::function<void()> seen) {
    signals.add(number);
    signals.async_wait([seen = std::move(seen)](boost::system::error_code, int) { seen(); });
}
