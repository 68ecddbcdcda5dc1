// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config_sources.hpp"

#include <optional>
#include <stdexcept>
#include <string>
#include <variant>

namespace cles::runtime {

/// What the command line asks for.
struct options {
    std::optional<std::string> config;
    bool check = false;        ///< only looks whether the configuration can be used
    bool print_config = false; ///< only prints it
    overrides flags;
};

/// A command line that cannot be understood.
class usage_error : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// The options, or what --help and --version print. \throws usage_error
std::variant<options, std::string> parse_options(int argc, const char* const* argv);

} // namespace cles::runtime
