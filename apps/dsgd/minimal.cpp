// SPDX-License-Identifier: BSL-1.0
// The paper's manager, and no more (docs/dsgd.md): it divides the data into shards, delegates them to the nodes in
// turn, and averages what comes back. `cles-dsgd` also survives lost nodes, divides by speed, and reports what took how
// long.
#include <cles/service.hpp>

#include "sgd/parallel.hpp"

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>

#include <charconv>
#include <cstdio>
#include <exception>
#include <string>

#include <unistd.h>

namespace {

struct manager {
    boost::asio::io_context io{1};
    cles::service node;
    std::vector<sgd::order> orders{};
    std::vector<sgd::trained> parts{};
    std::size_t open = 0;
    std::exception_ptr failure{}; ///< the first

    explicit manager(const char* seed)
        : node(io, {.name = "manager-" + std::to_string(::getpid()),
                    .gossip = cles::gossip({seed}),
                    .routing = cles::routing()}) {}

    boost::asio::awaitable<void> delegate(std::size_t i, std::string noun) {
        const auto options = cles::call_options{}.deadline(std::chrono::minutes{10});
        parts[i] = co_await node.async_delegate<sgd::trained>(noun, orders[i], options);
    }

    sgd::classifier train(std::size_t shards, std::uint64_t epochs, const std::vector<std::string>& targets) {
        const auto data = cles::from_json<sgd::recipe>(node.request("PULL " + targets.front() + ":sgd"));
        const auto even = sgd::divide(2 * data.per_class, std::vector<double>(shards, 1));
        orders = sgd::orders_for(even, {.epochs = epochs, .rate = 1e-4, .seed = 1, .data = data});
        parts.resize(shards);
        open = shards;
        for (std::size_t i = 0; i < shards; ++i) {
            const auto noun = targets[i % targets.size()] + ":sgd/train";
            boost::asio::co_spawn(io, delegate(i, noun), [this](const std::exception_ptr& why) {
                failure = failure ? failure : why;
                --open;
            });
        }
        io.restart();
        while (open != 0 && !failure) {
            io.run_one();
        }
        if (failure) {
            std::rethrow_exception(failure);
        }
        return average(parts);
    }
};

/// 0 if it is not a number from 1 to the most.
std::uint64_t number(std::string_view text, std::uint64_t most) {
    std::uint64_t found = 0;
    const auto [end, failed] = std::from_chars(text.begin(), text.end(), found);
    return failed == std::errc{} && end == text.end() && found <= most ? found : 0;
}

} // namespace

int main(int argc, char** argv) try {
    const auto shards = argc < 5 ? 0 : number(argv[2], 1024);
    const auto epochs = argc < 5 ? 0 : number(argv[3], 1'000'000);
    if (shards == 0 || epochs == 0) {
        std::fputs("usage: cles-dsgd-minimal URL SHARDS EPOCHS NODE...\n"
                   "SHARDS: 1 to 1024; EPOCHS: 1 to 1000000\n",
                   stderr);
        return 2;
    }
    manager all{argv[1]};
    const auto result = all.train(shards, epochs, {argv + 4, argv + argc});
    std::puts(cles::to_json(result).c_str());
    return 0;
} catch (const std::exception& failure) {
    std::fprintf(stderr, "cles-dsgd-minimal: %s\n", failure.what());
    return 1;
}
