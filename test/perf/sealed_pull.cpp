// SPDX-License-Identifier: BSL-1.0
// In steady state, a PULL allocates nothing at a secured service: by sealed datagrams, and over `tls`, except for what
// OpenSSL allocates and frees for each record. Prints also what sealing adds to the latency. Service and client run in
// processes of their own.
#include <cles/security.hpp>
#include <cles/service.hpp>

#include "counted_allocations.hpp"
#include "fleet_folder.hpp"
#include "security/datagrams/noise_kk.hpp"

#include <boost/asio/io_context.hpp>

#include <openssl/crypto.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include <stdlib.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

namespace {

using steady = std::chrono::steady_clock;

constexpr std::uint64_t warm_up = 3'000;
constexpr std::uint64_t counted = 10'000;
constexpr std::uint64_t files_looked_at = 50; // allocations of the node, which looks at its files each second

double in_us(steady::duration d) { return std::chrono::duration<double, std::micro>(d).count(); }

double median(std::vector<double>& all) {
    std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2), all.end());
    return all[all.size() / 2];
}

// OpenSSL's are counted separately. For each record, OpenSSL 3.0 takes some blocks of 40 bytes and frees them again:
// one when it reads, three when it writes.
std::uint64_t allocations_of_openssl = 0;

void* openssl_malloc(std::size_t size, const char*, int) {
    ++allocations_of_openssl;
    return __libc_malloc(size);
}
void* openssl_realloc(void* memory, std::size_t size, const char*, int) {
    ++allocations_of_openssl;
    return __libc_realloc(memory, size);
}
void openssl_free(void* memory, const char*, int) { ::free(memory); }

cles::service_options options_of(const char* name, const std::string& scheme, const fleet_folder* sealed) {
    cles::service_options made{.name = name, .listen = {scheme + "://127.0.0.1:0"}};
    if (sealed != nullptr) {
        made.security = cles::secured(sealed->of(name));
    }
    return made;
}

/// Pulls one by one; prints nothing. \return the median latency in microseconds
double pull(const std::string& url, const std::string& scheme, const fleet_folder* sealed) {
    boost::asio::io_context io{1};
    auto options = options_of("car2", scheme, sealed);
    options.peers.emplace("car1", url);
    cles::service car2{io, std::move(options)};
    std::vector<double> took;
    took.reserve(counted);
    for (std::uint64_t i = 0; i < warm_up + counted + 64; ++i) {
        bool done = false;
        const auto begun = steady::now();
        car2.async_request("PULL car1:speed", [&](boost::system::error_code code, const cles::json_text&) {
            if (code) {
                throw std::runtime_error(code.message());
            }
            done = true;
        });
        while (!done) {
            io.run_one();
        }
        if (i >= warm_up && took.size() < counted) {
            took.push_back(in_us(steady::now() - begun));
        }
    }
    bool told = false;
    car2.async_request("PUSH car1:done", [&](boost::system::error_code, const cles::json_text&) { told = true; });
    while (!told) {
        io.run_one();
    }
    return median(took);
}

struct result {
    double latency = 0;
    std::uint64_t allocated = 0;
    std::uint64_t by_openssl = 0;
};

result measure(const std::string& scheme, const fleet_folder* sealed) {
    std::array<int, 2> to_child{};
    std::array<int, 2> to_parent{};
    if (::pipe(to_child.data()) != 0 || ::pipe(to_parent.data()) != 0) {
        throw std::runtime_error("cannot create a pipe");
    }
    const auto child = ::fork();
    if (child == 0) {
        ::prctl(PR_SET_PDEATHSIG, SIGKILL);
        try {
            std::array<char, 200> url{};
            const auto size = ::read(to_child[0], url.data(), url.size());
            const auto latency = pull({url.data(), static_cast<std::size_t>(size)}, scheme, sealed);
            ::_exit(::write(to_parent[1], &latency, sizeof latency) == sizeof latency ? 0 : 1);
        } catch (const std::exception& failure) {
            std::fprintf(stderr, "client: %s\n", failure.what());
            ::_exit(1);
        }
    }
    boost::asio::io_context io{1};
    cles::service car1{io, options_of("car1", scheme, sealed)};
    std::uint64_t pulls = 0;
    result found;
    car1.on_pull("speed", [&] {
        ++pulls;
        if (pulls == warm_up) {
            found.allocated = allocations;
            found.by_openssl = allocations_of_openssl;
        } else if (pulls == warm_up + counted) {
            found.allocated = allocations - found.allocated;
            found.by_openssl = allocations_of_openssl - found.by_openssl;
        }
        return 7;
    });
    bool done = false;
    car1.on_push("done", [&] { done = true; });
    const auto url = car1.endpoints().front();
    if (::write(to_child[1], url.data(), url.size()) < 0) {
        throw std::runtime_error("cannot write to a pipe");
    }
    const auto end = steady::now() + std::chrono::seconds{30};
    while (!done && steady::now() < end) {
        io.run_one_for(std::chrono::milliseconds{100});
    }
    io.run_for(std::chrono::milliseconds{20}); // the last reply
    if (!done || ::read(to_parent[0], &found.latency, sizeof found.latency) != sizeof found.latency) {
        ::kill(child, SIGKILL);
        ::waitpid(child, nullptr, 0);
        throw std::runtime_error("the client did not complete");
    }
    ::waitpid(child, nullptr, 0);
    for (const auto each : {to_child[0], to_child[1], to_parent[0], to_parent[1]}) {
        ::close(each);
    }
    return found;
}

/// The mean time to seal a line like those that are exchanged, and to open one.
double seal_time() {
    std::array<std::uint8_t, 32> key{1, 2, 3};
    std::array<std::uint8_t, 20> head{};
    std::array<std::uint8_t, 40> line{};
    std::array<std::uint8_t, 56> sealed{};
    constexpr std::uint64_t times = 200'000;
    const auto begun = steady::now();
    for (std::uint64_t i = 0; i < times; ++i) {
        cles::security::noise_seal(key.data(), i, head, line, sealed.data());
        if (!cles::security::noise_open(key.data(), i, head, sealed, line.data())) {
            throw std::runtime_error("cannot open what was sealed");
        }
    }
    return in_us(steady::now() - begun) / (2.0 * times);
}

/// False if anything but OpenSSL has allocated for PULLs.
bool report(const char* how, const result& found) {
    std::printf("%s: %llu allocations in %llu PULLs, and %llu of OpenSSL\n", how,
                static_cast<unsigned long long>(found.allocated), static_cast<unsigned long long>(counted),
                static_cast<unsigned long long>(found.by_openssl));
    return found.allocated <= files_looked_at;
}

} // namespace

int main() {
    if (::CRYPTO_set_mem_functions(openssl_malloc, openssl_realloc, openssl_free) != 1) {
        std::fprintf(stderr, "OpenSSL has allocated already\n");
        return 1;
    }
    try {
        const fleet_folder folder;
        std::vector<double> plain;
        std::vector<double> sealed;
        bool good = true;
        for (int round = 0; round < 3; ++round) {
            plain.push_back(measure("udp", nullptr).latency);
            const auto found = measure("udp", &folder);
            sealed.push_back(found.latency);
            good = report("by sealed datagrams", found) && good;
        }
        good = report("over tls", measure("tls", &folder)) && good;
        const auto once = seal_time();
        std::printf("PULL, median: plain %.2f us, sealed %.2f us; to seal or to open a line: %.2f us\n", median(plain),
                    median(sealed), once);
        return good ? 0 : 1;
    } catch (const std::exception& failure) {
        std::fprintf(stderr, "%s\n", failure.what());
        return 1;
    }
}
