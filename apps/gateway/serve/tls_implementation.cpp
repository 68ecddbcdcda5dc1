// SPDX-License-Identifier: BSL-1.0
// The compiled part of Asio's TLS, which the library does not contain.
#include <boost/asio/ssl/impl/src.hpp>
