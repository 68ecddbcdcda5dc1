// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>

namespace tool {

enum class stream { out = 1, err = 2 };

bool is_terminal(stream s);

/// Whether to colour: only a terminal that can, and never where NO_COLOR is set (no-color.org).
bool has_colours(stream s);

/// The text in bold where the stream shows that.
std::string bold(stream s, std::string_view text);
/// The text in red where the stream shows that.
std::string red(stream s, std::string_view text);

/// Text from elsewhere made fit for a terminal: control characters, and those that turn the direction of writing,
/// become escapes, so that a peer's text cannot drive the terminal.
std::string printable(std::string_view text);

/// How many columns printable text takes, counting characters.
std::size_t width_of(std::string_view text);

} // namespace tool
