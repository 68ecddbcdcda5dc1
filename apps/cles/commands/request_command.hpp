// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/verb.hpp>

#include "options/addresses.hpp"
#include "output/printer.hpp"

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace CLI {
class App;
}

namespace tool {

struct context;

/// What the four verbs that are answered once have in common: the request, how often, and how its answers are shown.
class request_command {
  public:
    request_command(cles::verb verb, const context& shared) : verb_(verb), shared_(shared) {}

    void add_options(CLI::App& command);
    /// For a verb with a body only.
    void add_body_option(CLI::App& command);
    /// For all but UPDATE.
    void add_urgent_option(CLI::App& command);
    /// For DELEGATE.
    void add_progress_option(CLI::App& command);

    /// Gives the exit code.
    int run();

  private:
    friend struct request_loop;

    cles::verb verb_;
    const context& shared_;
    address_book addresses_;
    std::string noun_;
    std::optional<std::string> body_;
    std::optional<std::chrono::milliseconds> timeout_;
    std::uint64_t count_ = 1;
    std::chrono::milliseconds interval_{1000};
    output_format format_ = output_format::automatic;
    bool progress_ = false;
    bool urgent_ = false;
};

} // namespace tool
