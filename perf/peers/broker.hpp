// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/support/child_process.hpp"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace cles::perf::peers {

/// A program between the two ends, from its installed package, on the core of the server and with a folder of its own.
/// It ends with this object.
class broker {
  public:
    /// Its program and arguments, where its folder is known; called in its process.
    using command = std::function<std::vector<std::string>(const std::filesystem::path& folder)>;

    /// \throws not_offered where there is no such program
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

/// A port of the loopback interface that is free now, for programs that do not say which one they were given.
std::uint16_t free_port(int kind_of_socket);

} // namespace cles::perf::peers
