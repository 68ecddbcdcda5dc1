// SPDX-License-Identifier: BSL-1.0
// probe PLUGIN CONFIG COMMAND...: loads a plugin as clesd does, and prints the replies of its tasks.
#include <cles/service.hpp>

#include "plugins/plugin_host.hpp"

#include <boost/asio/io_context.hpp>

#include <exception>
#include <iostream>
#include <vector>

int main(int argc, char** argv) {
    const std::vector<std::string> arguments(argv + 1, argv + argc);
    try {
        boost::asio::io_context io;
        cles::service node{io, {.name = "node"}};
        cles::runtime::plugin_host host{{.node = "node"}};
        host.load(arguments.at(0), arguments.at(1), node);
        const auto& plugin = host.plugins().front();
        std::cout << plugin.name << ' ' << plugin.version << '\n';
        for (std::size_t i = 2; i < arguments.size(); ++i) {
            std::cout << node.request(arguments[i]) << '\n';
        }
        return 0;
    } catch (const std::exception& e) {
        std::cout << e.what() << '\n';
        return 1;
    }
}
