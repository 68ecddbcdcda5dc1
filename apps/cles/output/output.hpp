// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string_view>

namespace tool {

/// Writes all of the text to stdout, now, so that the reader of a pipe sees each document when it comes.
/// \throws output_closed, output_interrupted, or a system error
void write_output(std::string_view text);

/// Whether the reader of stdout has gone, where that can be known without writing.
bool is_output_closed();

} // namespace tool
