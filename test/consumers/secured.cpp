// SPDX-License-Identifier: BSL-1.0
// A program of another project with security: it makes a fleet of two nodes in the folder that is its argument, and has
// one ask the other.
#include <cles/security.hpp>
#include <cles/security/fleet_files.hpp>
#include <cles/security/node_files.hpp>
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>

#include <iostream>
#include <string>
#include <utility>

namespace {

cles::service_options options_of(const std::string& folder, const std::string& name) {
    return {.name = name, .listen = {"tls://127.0.0.1:0"}, .security = cles::secured(folder + "/" + name)};
}

} // namespace

int main(int argc, char** argv) {
    if (argc != 2) {
        return 2;
    }
    const std::string folder = argv[1];
    cles::security::create_fleet(folder);
    const auto car1 = cles::security::create_node_key(folder + "/car1", "car1");
    const auto car2 = cles::security::create_node_key(folder + "/car2", "car2");
    cles::security::add_members(folder, {car1.line, car2.line}, {});
    for (const std::string name : {"car1", "car2"}) {
        cles::security::join_fleet(folder + "/" + name, cles::security::describe_fleet(folder).line);
    }

    boost::asio::io_context io;
    cles::service server{io, options_of(folder, "car1")};
    server.on_pull("speed", [] { return 27.5; });
    auto options = options_of(folder, "car2");
    options.peers["car1"] = server.endpoints().front();
    cles::service client{io, std::move(options)};
    client.async_pull<double>("car1:speed", [&](boost::system::error_code code, double speed) {
        std::cout << (code ? code.message() : std::to_string(speed)) << "\n";
        server.stop();
        client.stop();
    });
    io.run();
}
