// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/support/child_process.hpp"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace cles::perf::peers {

/// A program between the two ends, as its package installed it, on the core of the server, with a folder of its own.
/// It ends with this object.
class broker {
  public:
    /// Returns its program and arguments, given its folder. Called in its process.
    using command = std::function<std::vector<std::string>(const std::filesystem::path& folder)>;

    /// \throws not_offered if the program is not installed
    explicit broker(const command& with);
    broker(const broker&) = delete;
    broker& operator=(const broker&) = delete;
    ~broker();

    [[nodiscard]] pid_t id() const noexcept { return process_.id(); }
    [[nodiscard]] const std::filesystem::path& folder() const noexcept { return folder_; }

  private:
    std::filesystem::path folder_;
    child_process process_;
};

/// A port of the loopback interface that is free now, for programs that do not report the one that the system chose.
std::uint16_t free_port(int kind_of_socket);

/// The first line that a program prints, such as the version of a broker; "no PROGRAM" if it is not installed.
/// \param command as a shell reads it
std::string first_line_of(const std::string& command);

} // namespace cles::perf::peers
