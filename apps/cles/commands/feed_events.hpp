// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed.hpp>

#include <string_view>

namespace tool {

/// Says on stderr what happened to a feed of this noun: updates missed, its publisher lost, found again.
void note_event(std::string_view noun, const cles::feed_item<cles::json_text>& item);

} // namespace tool
