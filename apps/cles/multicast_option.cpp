// SPDX-License-Identifier: BSL-1.0
#include "multicast_option.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <string>

namespace tool {

void add_multicast_option(CLI::App& command, cles::multicast_options& where) {
    command
        .add_option_function<std::string>(
            "-m,--multicast", [&where](const std::string& text) { where = cles::parse_multicast(text); },
            "The interface by which nodes find each other, as in eth0, or off (default lo)")
        ->type_name("IFACE[,GROUP[:PORT]]")
        ->envname("CLES_MULTICAST");
}

} // namespace tool
