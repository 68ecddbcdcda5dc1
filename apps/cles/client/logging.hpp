// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>

#include <memory>

namespace tool {

class log_writer;

// The library's log goes to stderr, in colour if that is a terminal and NO_COLOR is not set.

/// A client logs nothing by default, because failures are reported anyway; with -v from level info, with -vv
/// everything, and each line that is sent or received.
cles::log_sink make_client_log(int verbosity);

/// A server logs from level info, with -v everything, and with -vv each line too. It goes on if nobody reads its log:
/// lines are dropped then.
class server_log {
  public:
    explicit server_log(int verbosity);
    server_log(const server_log&) = delete;
    server_log& operator=(const server_log&) = delete;
    /// Writes the last lines. Links that are logged may outlive it.
    ~server_log();

    [[nodiscard]] const cles::log_sink& sink() const noexcept { return sink_; }

  private:
    std::shared_ptr<log_writer> writer_;
    cles::log_sink sink_;
};

} // namespace tool
