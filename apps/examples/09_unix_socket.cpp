// SPDX-License-Identifier: BSL-1.0
// On one host a Unix socket takes less time than TCP, and the kernel identifies the user at the other end.
#include <cles/service.hpp>

#include <boost/asio/io_context.hpp>

#include <filesystem>
#include <iostream>

#include <unistd.h>

namespace fs = std::filesystem;

int main() {
    const auto file = fs::temp_directory_path() / ("cles-example-" + std::to_string(getpid()) + ".sock");
    const auto url = "unix://" + file.string();

    boost::asio::io_context io;
    cles::service car{io, {.name = "car", .listen = {url, "unix://@cles-example-" + std::to_string(getpid())}}};
    car.on_pull("me",
                [](const cles::request& asked) { return asked.peer().uid == getuid() ? "my own user" : "another"; });

    cles::service me{io, {.name = "me"}};
    for (const auto& endpoint : car.endpoints()) { // a socket file, and an abstract one that has no file
        std::cout << me.request("PULL car:me", cles::call_options{}.at(endpoint)) << '\n';
    }
    const bool private_to_me =
        (fs::status(file).permissions() & fs::perms::mask) == (fs::perms::owner_read | fs::perms::owner_write);
    std::cout << (private_to_me ? "only this user may connect\n" : "others may connect\n");
    car.stop();
    std::cout << (fs::exists(file) ? "the file is still there\n" : "the file was removed\n");
}

// Prints:
// {"value":"my own user"}
// {"value":"my own user"}
// only this user may connect
// the file was removed
