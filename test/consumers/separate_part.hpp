// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <boost/asio/signal_set.hpp>
#include <boost/system/error_code.hpp>

#include <functional>

const boost::system::error_category& category_in_separate_part();
void await_signal(boost::asio::signal_set& signals, int number, std::function<void()> seen);
