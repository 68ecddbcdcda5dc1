// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <string>

namespace cles::runtime {

/// While a plugin starts in this process, ends the process with a chosen exit code and one line on stderr if the plugin
/// crashes, calls `exit`, or takes longer than the limit. SIGTERM and SIGINT have their default effect and end the
/// process, because the thread that would handle them waits for the plugin.
///
/// One at a time, on the main thread.
class plugin_start_guard {
  public:
    /// \param who begins the line: "clesd: clesd.yaml:7: plugins[0].path: mine.so"
    plugin_start_guard(const std::string& who, int exit_code, std::chrono::seconds limit);
    plugin_start_guard(const plugin_start_guard&) = delete;
    plugin_start_guard& operator=(const plugin_start_guard&) = delete;
    ~plugin_start_guard();
};

} // namespace cles::runtime
