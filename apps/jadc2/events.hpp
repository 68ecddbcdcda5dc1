// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>

#include "audit_file.hpp"
#include "fixed_number.hpp"
#include "output/log_writer.hpp"

#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <vector>

namespace jadc2 {

/// Seconds since 1970.
double utc_now();

/// Logs events on stdout: a line of text, and more lines below it, or a JSON object per line with `utc`, `who`,
/// `event`, `text`, which contains all lines, and `data`. Text may contain what others have sent: it does not begin a
/// line. It never waits for its reader, and drops events instead.
class event_log {
  public:
    /// \param audit_path the file to which all events but pictures and silence are added, too, as JSON; empty: none
    /// \throws std::runtime_error if that cannot be opened
    event_log(std::string who, bool json, const std::string& audit_path = {});

    using lines = std::vector<std::string>;

    void log(std::string_view event, std::string_view text) const { write(event, text, {}, "{}"); }
    template <class T>
    void log(std::string_view event, std::string_view text, const T& data, const lines& more = {}) const {
        write(event, text, more, cles::to_json(data));
    }

    /// Writes to the file alone.
    void audit(std::string_view event, std::string_view text) const;
    /// Whether an event could not be added to the file, so that nothing may happen that it has to contain.
    [[nodiscard]] bool audit_is_broken() const noexcept { return audit_ && audit_->is_broken(); }

  private:
    void write(std::string_view event, std::string_view text, const lines& more, std::string_view data) const;

    std::string who_;
    bool json_;
    std::shared_ptr<tool::log_writer> out_;
    std::shared_ptr<audit_file> audit_; ///< null if there is none
};

/// A random number that identifies this run.
inline std::string run_id() {
    std::random_device chance;
    return std::to_string(chance());
}

} // namespace jadc2
