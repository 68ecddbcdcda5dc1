// SPDX-License-Identifier: BSL-1.0
#include "options/multicast_option.hpp"

#include <cles/error.hpp>

#include "output/failure.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <cstdlib>

namespace tool {
namespace {

cles::multicast_options read(const std::string& text, const std::string& whence) {
    try {
        return cles::parse_multicast(text);
    } catch (const cles::error& e) {
        throw usage_error(whence + ": " + e.message());
    }
}

} // namespace

void multicast_option::add_to(CLI::App& command, const std::string& help) {
    command
        .add_option_function<std::string>(
            "-m,--multicast",
            [this](const std::string& text) {
                read(text, "--multicast");
                given_ = text;
            },
            help + " (default CLES_MULTICAST, or else lo)")
        ->type_name("IFACE[,IFACE...][,GROUP[:PORT]]|auto|off");
}

cles::multicast_options multicast_option::where() const {
    if (is_given()) {
        return read(given_, "--multicast");
    }
    if (const char* wanted = std::getenv("CLES_MULTICAST"); wanted != nullptr && *wanted != '\0') {
        return read(wanted, "CLES_MULTICAST");
    }
    cles::multicast_options otherwise{.interface = "lo"};
    otherwise.required = false;
    return otherwise;
}

void multicast_option::narrow_to(const std::vector<std::string>& interfaces) {
    if (interfaces.empty()) {
        turn_off();
        return;
    }
    const auto group = where();
    given_ = names_of(interfaces, ",") + "," + group.group + ":" + std::to_string(group.port);
}

std::string names_of(const std::vector<std::string>& interfaces, const char* between) {
    std::string all;
    for (const auto& each : interfaces) {
        all.append(all.empty() ? "" : between).append(each);
    }
    return all;
}

} // namespace tool
