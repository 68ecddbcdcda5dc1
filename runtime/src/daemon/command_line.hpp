// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config_sources.hpp"

#include <optional>
#include <stdexcept>
#include <string>
#include <variant>

namespace cles::runtime {

/// The options of the command line.
struct command_line_options {
    std::optional<std::string> config;
    bool check = false;        ///< only check whether the configuration can be used
    bool print_config = false; ///< only print it
    overrides flags;
};

/// An invalid command line.
class usage_error : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// The options, or the text of --help or --version. \throws usage_error
std::variant<command_line_options, std::string> parse_command_line(int argc, const char* const* argv);

} // namespace cles::runtime
