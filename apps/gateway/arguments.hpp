// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "options/addresses.hpp"
#include "options/keys_option.hpp"

#include <cstddef>
#include <string>
#include <vector>

namespace CLI {
class App;
}

/// The command line of `cles gateway`. Both `cles`, for its help and completion, and `cles-gateway` are compiled with
/// it.
namespace tool {

/// The options as given.
struct gateway_arguments {
    std::vector<std::string> http{};
    std::string certificate{};
    std::string certificate_key{};
    bool behind_proxy = false;
    std::vector<std::string> hosts{};
    std::vector<std::string> origins{};
    std::string tokens{};
    std::string new_token{};
    std::size_t connections = 1024;
    std::size_t connections_per_address = 128;
    std::string collector{};

    std::string name{};
    std::string pool{};
    std::vector<std::string> listen{};
    std::vector<std::string> peers{};
    std::vector<std::string> seeds{};
    bool insecure = false;
    std::string nats{};
    std::string nats_credentials{};
    keys_option keys{};
    multicast_option multicast{};
};

/// Adds description, examples and options to the command.
void add_gateway_arguments(CLI::App& command, gateway_arguments& given);

} // namespace tool
