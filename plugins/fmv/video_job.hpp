// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/request.hpp>
#include <cles/responder.hpp>

#include "workshop.hpp"

#include <memory>

namespace fmv {

/// Begins to receive a video: binds its frames at the requester, and reports what is found in each as progress, until
/// the video ends, or nobody waits any more. It holds no worker while it waits for a frame. \throws cles::error if the
/// request is wrong
void open_video(const cles::request& asked, const cles::responder& answer, const std::shared_ptr<workshop>& here);

} // namespace fmv
