// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace tool {

/// What the subcommands share with `main`.
struct context {
    int exit_code = 0;
    int verbosity = 0; ///< how often -v was given
};

} // namespace tool
