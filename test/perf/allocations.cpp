// SPDX-License-Identifier: BSL-1.0
// In steady state, a PULL allocates nothing at the service. The service runs in this process, whose allocations are
// counted; the client in another one.
#include <cles/service.hpp>

#include "counted_allocations.hpp"
#include "scripted_client.hpp"

#include <boost/asio/io_context.hpp>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <functional>
#include <string>
#include <vector>

#include <sys/prctl.h>
#include <sys/wait.h>

namespace {

// --- The service -----------------------------------------------------------------------------------------------------

constexpr std::uint64_t warm_up = 5'000;
constexpr std::uint64_t counted = 10'000;
// A handler of `std::function` and the like must not be what makes the difference: the client sends some requests more.
constexpr std::uint64_t sent = warm_up + counted + 64;

/// The number of allocations between the first counted request and the last.
std::uint64_t allocations_of(const char* listen, const std::function<void(const std::string&)>& client) {
    boost::asio::io_context io{1};
    cles::service car{io, {.name = "car1", .listen = {listen}}};
    std::uint64_t pulls = 0;
    std::uint64_t before = 0;
    std::uint64_t after = 0;
    car.on_pull("localization", [&] {
        ++pulls;
        if (pulls == warm_up) {
            before = allocations;
        } else if (pulls == warm_up + counted) {
            after = allocations;
        }
        return localization{.utc = 1'700'000'000.5 + static_cast<double>(pulls) / 1000};
    });
    car.on_push("done", [&] { io.stop(); });

    const auto endpoint = car.endpoints().front();
    const auto child = ::fork();
    if (child < 0) {
        throw std::system_error(errno, std::generic_category(), "fork");
    }
    if (child == 0) {
        ::prctl(PR_SET_PDEATHSIG, SIGKILL);
        try {
            client(endpoint);
            ::_exit(0);
        } catch (const std::exception& failure) {
            std::fprintf(stderr, "client: %s\n", failure.what());
            ::_exit(1);
        }
    }
    // If the client fails, the service only notices the end of its link, and must not wait for ever.
    io.run_for(std::chrono::seconds{30});
    ::kill(child, SIGKILL);
    ::waitpid(child, nullptr, 0);
    if (pulls < sent) {
        throw std::runtime_error("only " + std::to_string(pulls) + " of " + std::to_string(sent) + " requests came");
    }
    return after - before;
}

// --- The clients -----------------------------------------------------------------------------------------------------

void one_by_one(const std::string& url, const std::function<std::string(std::uint64_t)>& request) {
    scripted_client client{url};
    for (std::uint64_t i = 1; i <= sent; ++i) {
        client.send(request(i));
        client.receive_line();
    }
    client.send("PUSH self:done id=1 reply=no\n");
    client.receive_line();
}

void in_batches(const std::string& url, std::uint64_t size) {
    scripted_client client{url};
    for (std::uint64_t i = 0; i < sent; i += size) {
        std::string batch;
        for (std::uint64_t n = i; n < i + size; ++n) {
            batch += "PULL car1:localization id=" + std::to_string(n + 1) + " deadline=5000\n";
        }
        client.send(batch);
        for (std::uint64_t n = 0; n < size; ++n) {
            client.receive_line();
        }
    }
    client.send("PUSH self:done id=1 reply=no\n");
    client.receive_line();
}

struct scenario {
    const char* name;
    const char* listen;
    std::function<void(const std::string&)> client;
};

} // namespace

int main() {
    const std::vector<scenario> scenarios{
        {"a person's request, without id", "tcp://127.0.0.1:0",
         [](const std::string& url) { one_by_one(url, [](std::uint64_t) { return "PULL self:localization\n"; }); }},
        {"a node's request, with id and deadline", "tcp://127.0.0.1:0",
         [](const std::string& url) {
             one_by_one(url, [](std::uint64_t i) {
                 return "PULL car1:localization id=" + std::to_string(i) + " deadline=5000\n";
             });
         }},
        {"by datagram, with id and deadline", "udp://127.0.0.1:0",
         [](const std::string& url) {
             one_by_one(url, [](std::uint64_t i) {
                 return "PULL car1:localization id=" + std::to_string(i) + " deadline=5000\n";
             });
         }},
        {"64 in flight", "tcp://127.0.0.1:0", [](const std::string& url) { in_batches(url, 64); }},
    };
    bool good = true;
    for (const auto& each : scenarios) {
        try {
            const auto found = allocations_of(each.listen, each.client);
            std::printf("%-40s %llu allocations in %llu PULLs\n", each.name, static_cast<unsigned long long>(found),
                        static_cast<unsigned long long>(counted));
            good = good && found == 0;
        } catch (const std::exception& failure) {
            std::printf("%-40s %s\n", each.name, failure.what());
            good = false;
        }
        std::fflush(stdout);
    }
    return good ? 0 : 1;
}
