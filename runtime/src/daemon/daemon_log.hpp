// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>

#include "config/config.hpp"
#include "output/log_writer.hpp"

#include <memory>
#include <string>
#include <string_view>

namespace cles::runtime {

/// A log entry for people, on one line: "sat1 tcp://127.0.0.1:4242 id=7: denied". It is printable, so that a peer's
/// text can neither control a terminal nor start a new line.
std::string format_text(std::string_view node, const log_entry& entry);

/// The same as the members of a JSON object, without braces: `"node":"sat1","peer":"tcp://…","id":7,"trace":"4bf9…",
/// "message":"…"`. Missing ones are omitted. It is printable, too.
std::string format_json(std::string_view node, const log_entry& entry);

/// The daemon's log, on stderr: text, in colour on a terminal (unless NO_COLOR is set), or JSON, one object per line.
/// Never waits for its reader, and drops lines instead. May be used from any thread.
class daemon_log {
  public:
    daemon_log(std::string node, log_config how);

    /// Changes level and format.
    void set(log_config how);
    void write(log_level level, const log_entry& entry);

    void info(std::string_view text) { write(log_level::info, text); }
    void warning(std::string_view text) { write(log_level::warning, text); }
    void error(std::string_view text) { write(log_level::error, text); }

    /// For functions that take a sink; the log has to outlive it.
    [[nodiscard]] log_sink sink();
    /// Waits until its lines are written, if somebody reads them: before other output, and before what may end the
    /// process.
    void flush() { writer_.flush(); }
    /// Before the process ends without destructors: as they do, writes what is left, if somebody reads it.
    void close() { writer_.close(); }

  private:
    struct style;

    const std::shared_ptr<style> style_; // the writer's thread uses it, too
    tool::log_writer writer_;
};

} // namespace cles::runtime
