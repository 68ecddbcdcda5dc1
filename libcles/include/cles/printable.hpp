// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string>
#include <string_view>

namespace cles {

/// Makes text from elsewhere safe to show, for example on a terminal or in a log: control characters (C0, DEL and C1),
/// and characters that change the direction of writing, become escapes such as `\n` and `\u009b`. What is not UTF-8
/// becomes U+FFFD.
///
/// Printable text stays as it is, so the function may be applied twice. Compact JSON stays JSON with the same meaning,
/// because it contains such characters only in strings.
std::string printable(std::string_view text);

} // namespace cles
