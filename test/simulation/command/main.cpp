// SPDX-License-Identifier: BSL-1.0
// Simulates seeds, or plans that lie in files, and tells what was broken (README.md of the folder above).
#include "simulation/world/simulate.hpp"

#include <charconv>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace {

using namespace cles::simulation;

constexpr std::string_view usage = R"(usage: cles_simulation [options] [FILE...]
  --seed N        the first seed (1)
  --seeds M       how many (1)
  --steps K       what happens in each from the outside (300)
  --twice         each twice, to see that both are the same
  --trace         tells all that happens
  --minimise      makes a plan that fails smaller, and prints it
  --plan          prints the plans and simulates nothing
  --plant FAULT   with this fault planted
  --bench         tells how much was simulated
  FILE            plans in files, instead of seeds
)";

struct options {
    std::uint64_t seed = 1;
    std::uint64_t seeds = 1;
    unsigned steps = 300;
    bool twice = false;
    bool trace = false;
    bool minimise = false;
    bool print = false;
    bool bench = false;
    planted fault = planted::none;
    std::vector<std::string> files{};
};

std::uint64_t number(std::string_view text) {
    std::uint64_t value = 0;
    const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (failed != std::errc{} || end != text.data() + text.size()) {
        throw std::runtime_error{"'" + std::string{text} + "' is no number"};
    }
    return value;
}

options read(const std::vector<std::string>& words) {
    options o;
    for (std::size_t i = 0; i < words.size(); ++i) {
        const auto& word = words[i];
        const auto next = [&]() -> const std::string& {
            if (++i == words.size()) {
                throw std::runtime_error{word + " wants a value"};
            }
            return words[i];
        };
        if (word == "--seed") {
            o.seed = number(next());
        } else if (word == "--seeds") {
            o.seeds = number(next());
        } else if (word == "--steps") {
            o.steps = static_cast<unsigned>(number(next()));
        } else if (word == "--twice") {
            o.twice = true;
        } else if (word == "--trace") {
            o.trace = true;
        } else if (word == "--minimise") {
            o.minimise = true;
        } else if (word == "--plan") {
            o.print = true;
        } else if (word == "--bench") {
            o.bench = true;
        } else if (word == "--plant") {
            const auto fault = planted_from(next());
            if (!fault) {
                throw std::runtime_error{"there is no such fault to plant"};
            }
            o.fault = *fault;
        } else if (word.starts_with("-")) {
            throw std::runtime_error{"unknown option " + word};
        } else {
            o.files.push_back(word);
        }
    }
    return o;
}

struct totals {
    double node_seconds = 0;
    std::uint64_t requests = 0;
    std::uint64_t updates = 0;
    std::uint64_t datagrams = 0;
    std::uint64_t steps = 0;
};

/// Whether it went well.
bool live_through(const plan& p, const std::string& name, const options& o, totals& sum) {
    if (o.print) {
        std::fputs(to_text(p).c_str(), stdout);
        return true;
    }
    witness::reader reader;
    if (o.trace) {
        reader = [](const std::string& line) { std::printf("%s\n", line.c_str()); };
    }
    const auto r = o.twice ? simulate_twice(p, o.fault) : simulate(p, o.fault, reader);
    sum.node_seconds += r.node_seconds;
    sum.requests += r.requests;
    sum.updates += r.updates;
    sum.datagrams += r.datagrams;
    sum.steps += r.steps;
    for (const auto& v : r.violations) {
        std::printf("%s: %s: %s\n", name.c_str(), std::string{to_string(v.broken)}.c_str(), v.what.c_str());
    }
    if (!r.violations.empty() && o.minimise) {
        const auto broken = r.violations.front().broken;
        const auto small = minimise(p, broken, o.fault);
        std::printf("# %s: %s\n%s", std::string{to_string(broken)}.c_str(), r.violations.front().what.c_str(),
                    to_text(small).c_str());
    }
    return r.violations.empty();
}

plan plan_of(const std::string& path) {
    std::ifstream file{path, std::ios::binary};
    if (!file) {
        throw std::runtime_error{path + " cannot be read"};
    }
    const std::string text{std::istreambuf_iterator<char>{file}, {}};
    return plan_from(text);
}

int run(const options& o) {
    totals sum;
    std::uint64_t failed = 0;
    const auto begun = std::chrono::steady_clock::now();
    for (const auto& path : o.files) {
        failed += live_through(plan_of(path), path, o, sum) ? 0 : 1;
    }
    for (std::uint64_t i = 0; o.files.empty() && i < o.seeds; ++i) {
        const auto seed = o.seed + i;
        failed += live_through(make_plan(seed, o.steps), "seed " + std::to_string(seed), o, sum) ? 0 : 1;
    }
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begun;
    if (o.bench) {
        std::printf("%.0f node-seconds with %llu requests, %llu updates, %llu datagrams, %llu events in %.2f s\n",
                    sum.node_seconds, static_cast<unsigned long long>(sum.requests),
                    static_cast<unsigned long long>(sum.updates), static_cast<unsigned long long>(sum.datagrams),
                    static_cast<unsigned long long>(sum.steps), took.count());
    }
    if (!o.print) {
        std::printf("%llu of %llu failed\n", static_cast<unsigned long long>(failed),
                    static_cast<unsigned long long>(o.files.empty() ? o.seeds : o.files.size()));
    }
    return failed == 0 ? 0 : 1;
}

} // namespace

int main(int argc, char** argv) {
    try {
        const std::vector<std::string> words{argv + 1, argv + argc};
        if (words.size() == 1 && (words[0] == "--help" || words[0] == "-h")) {
            std::fputs(usage.data(), stdout);
            return 0;
        }
        return run(read(words));
    } catch (const std::exception& e) {
        std::fprintf(stderr, "cles_simulation: %s\n%s", e.what(), usage.data());
        return 2;
    }
}
