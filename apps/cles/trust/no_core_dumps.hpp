// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <sys/resource.h>

namespace tool {

/// While it exists, this process leaves no core dump, and other processes of the user cannot read its memory. For
/// commands that read private keys.
class no_core_dumps {
  public:
    /// \throws std::system_error
    no_core_dumps();
    no_core_dumps(const no_core_dumps&) = delete;
    no_core_dumps& operator=(const no_core_dumps&) = delete;
    ~no_core_dumps();

  private:
    rlimit limit_{};
    int dumpable_ = 0;
};

} // namespace tool
