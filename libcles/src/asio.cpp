// SPDX-License-Identifier: BSL-1.0

// The compiled part of Asio, once for all.
#include <boost/asio/impl/src.hpp>
