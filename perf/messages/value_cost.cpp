// SPDX-License-Identifier: BSL-1.0
// How long it takes to read the localization packet from JSON into a described struct, and to write it: medians of
// passes, in nanoseconds. If simdjson was found when this was built, its on-demand reader reads the same texts in turn.
//
//   cles_value_cost               prints these times
//   cles_value_cost exact N       writes and reads N random doubles, and compares each with the standard library
#include <cles/convert.hpp>

#include "perf/support/localization.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <random>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#ifdef CLES_HAS_SIMDJSON
#include <simdjson.h>
#endif

namespace {

namespace perf = cles::perf;
using clock_type = std::chrono::steady_clock;

constexpr int passes = 15;
constexpr std::uint64_t repetitions = 200'000;
constexpr std::size_t kinds = 64; // of samples

template <class T>
void keep(const T& value) { // otherwise the compiler would leave out what is not used
    asm volatile("" : : "r"(&value) : "memory");
}

/// What is done to one value.
struct row {
    const char* what;
    std::function<void(std::uint64_t)> run;
    std::vector<double> times{};
};

void time_pass(row& each) {
    const auto began = clock_type::now();
    each.run(repetitions);
    const auto took = std::chrono::duration<double, std::nano>(clock_type::now() - began).count();
    each.times.push_back(took / static_cast<double>(repetitions));
}

double median(std::vector<double> times) {
    std::sort(times.begin(), times.end());
    return times[times.size() / 2];
}

using values = std::array<perf::localization, kinds>;
using texts = std::array<std::string, kinds>;

void read_all(const texts& from, std::uint64_t count) {
    for (std::uint64_t i = 0; i < count; ++i) {
        perf::localization value;
        if (!cles::from_json(from[i % kinds], value)) {
            throw std::runtime_error("a value cannot be read");
        }
        keep(value);
    }
}

void write_all(const values& from, std::uint64_t count) {
    std::string text;
    for (std::uint64_t i = 0; i < count; ++i) {
        text.clear();
        cles::json_writer writer{text};
        cles::write_json(writer, from[i % kinds]);
        keep(text);
    }
}

#ifdef CLES_HAS_SIMDJSON
void read_by_simdjson(const texts& from, std::uint64_t count) {
    std::vector<simdjson::padded_string> padded(from.begin(), from.end());
    simdjson::ondemand::parser parser;
    for (std::uint64_t i = 0; i < count; ++i) {
        perf::localization value;
        auto document = parser.iterate(padded[i % kinds]);
        auto object = document.get_object();
        if (object["utc"].get(value.utc) != simdjson::SUCCESS || object["lat"].get(value.lat) != simdjson::SUCCESS ||
            object["lon"].get(value.lon) != simdjson::SUCCESS ||
            object["velocity"].get(value.velocity) != simdjson::SUCCESS ||
            object["acceleration"].get(value.acceleration) != simdjson::SUCCESS) {
            throw std::runtime_error("simdjson cannot read a value");
        }
        keep(value);
    }
}
#endif

// Any bits, decimals of any number of digits, and numbers of the size that measurements have.
double draw_double(std::mt19937_64& draw, std::uint64_t n) {
    const auto bits = draw();
    switch (n % 3) {
    case 0: return std::bit_cast<double>(bits);
    case 1: return static_cast<double>(bits >> (draw() % 60)) / std::pow(10.0, static_cast<double>(draw() % 16));
    default: return std::uniform_real_distribution<double>{-1e3, 1e3}(draw);
    }
}

bool is_same(double a, double b) { return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b); }

double read_double(std::string_view text) {
    double read = 0;
    if (!cles::from_json(text, read)) {
        throw std::runtime_error("not read: " + std::string{text});
    }
    return read;
}

// Both ways: what is written here is read back, is as short as what the standard library writes, and what that writes
// is read too.
void check_exactness(std::uint64_t count) {
    std::mt19937_64 draw{20261130};
    std::array<char, 32> memory{};
    for (std::uint64_t n = 0; n < count; ++n) {
        const auto value = draw_double(draw, n);
        if (!std::isfinite(value)) {
            continue;
        }
        const auto written = cles::to_json(value);
        const auto* const end = std::to_chars(memory.data(), memory.data() + memory.size(), value).ptr;
        const std::string_view shortest{memory.data(), static_cast<std::size_t>(end - memory.data())};
        double parsed = 0;
        std::from_chars(written.data(), written.data() + written.size(), parsed);
        if (!is_same(read_double(written), value) || !is_same(parsed, value) ||
            !is_same(read_double(shortest), value)) {
            throw std::runtime_error("not exact: " + std::string{shortest} + ", written as " + written);
        }
    }
    std::printf("%ju doubles are exact both ways\n", static_cast<std::uintmax_t>(count));
}

void print_times() {
    values rounded;
    values unrounded;
    texts rounded_texts;
    texts unrounded_texts;
    for (std::size_t i = 0; i < kinds; ++i) {
        rounded[i] = perf::sample(i);
        unrounded[i] = perf::unrounded_sample(i);
        rounded_texts[i] = cles::to_json(rounded[i]);
        unrounded_texts[i] = cles::to_json(unrounded[i]);
    }
    std::vector<row> rows{
        {"read, rounded values", [&](std::uint64_t n) { read_all(rounded_texts, n); }},
        {"read, all digits", [&](std::uint64_t n) { read_all(unrounded_texts, n); }},
        {"write, rounded values", [&](std::uint64_t n) { write_all(rounded, n); }},
        {"write, all digits", [&](std::uint64_t n) { write_all(unrounded, n); }},
    };
#ifdef CLES_HAS_SIMDJSON
    rows.push_back({"simdjson " SIMDJSON_VERSION " on demand, rounded values",
                    [&](std::uint64_t n) { read_by_simdjson(rounded_texts, n); }});
    rows.push_back({"simdjson " SIMDJSON_VERSION " on demand, all digits",
                    [&](std::uint64_t n) { read_by_simdjson(unrounded_texts, n); }});
#endif
    for (int pass = 0; pass < passes; ++pass) {
        for (auto& each : rows) {
            time_pass(each);
        }
    }
    std::printf("localization, %zu bytes rounded, %zu with all digits; ns, medians of %d passes\n",
                rounded_texts[0].size(), unrounded_texts[0].size(), passes);
    for (const auto& each : rows) {
        std::printf("%-46s %6.1f\n", each.what, median(each.times));
    }
}

} // namespace

int main(int argc, char** argv) {
    try {
        const std::vector<std::string> words(argv + 1, argv + argc);
        if (words.empty()) {
            print_times();
        } else if (words.size() == 2 && words[0] == "exact") {
            check_exactness(std::stoull(words[1]));
        } else {
            throw std::invalid_argument("the arguments are none, or: exact N");
        }
        return EXIT_SUCCESS;
    } catch (const std::exception& failure) {
        std::fprintf(stderr, "cles_value_cost: %s\n", failure.what());
        return EXIT_FAILURE;
    }
}
