// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "image.hpp"
#include "messages.hpp"

#include <string>

/// What frames have to be. All throw `cles::error` with `bad_request`, which names what is wrong.

namespace fmv {

void require(bool fits, const char* what);
void check_utc(double utc);
void check(const camera_message& from);
/// The size of a video, in a format that this node has.
extent checked_size(int width, int height, const std::string& format);
grey decoded(const std::string& picture, extent size, const std::string& format);

} // namespace fmv
