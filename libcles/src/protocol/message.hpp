// SPDX-License-Identifier: BSL-1.0
#pragma once

/// All that crosses a link.
#include "protocol/datagram.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"
