// SPDX-License-Identifier: BSL-1.0
// The paper's interface (Listing 1.1), for programs without an event loop: each service has a thread of its own.
#include <cles/paper.hpp>

#include <ctime>
#include <future>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

CLES_Response getSystemTime(std::vector<std::string> args) {
    if (!args.empty() && args[0] != "UTC") {
        throw std::invalid_argument("the zone is UTC");
    }
    CLES_Response response;
    response["systemTime"] = std::time(nullptr); // seconds since 1970
    return response;
}

int main() {
    CLES_Service device1("device1", "127.0.0.1", 0); // port 0: a free one
    device1.registerPullFunction("systemTime", getSystemTime);
    device1.registerBindFunction("track", [] {});
    device1.run();

    CLES_Service device2("device2", "127.0.0.1", 0);
    device2.native().set_peer("device1", device1.native().endpoints().front()); // needed only without multicast
    std::promise<CLES_Response> updated;
    device2.registerUpdateFunction("track",
                                   [&](std::vector<std::string>, CLES_Response track) { updated.set_value(track); });
    device2.run();

    CLES_Response response = device2.makeCLESRequest("PULL device1:systemTime/UTC");
    std::cout << response << '\n';

    device2.makeCLESRequest("BIND device1:track");
    device1.makeCLESRequest(R"(UPDATE device1:track {"x":3,"y":4})");
    std::cout << updated.get_future().get() << '\n';

    device2.stop();
    device1.stop();
}

// Prints:
// {"systemTime":...}
// {"x":3,"y":4}
