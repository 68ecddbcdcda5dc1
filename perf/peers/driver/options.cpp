// SPDX-License-Identifier: BSL-1.0
#include "options.hpp"

#include <charconv>
#include <map>
#include <stdexcept>
#include <string_view>

namespace cles::perf::peers {
namespace {

struct bounded {
    std::uint32_t options::*into;
    std::uint32_t least;
    std::uint32_t most;
};

const std::map<std::string_view, bounded> numbers{
    {"--in-flight", {&options::in_flight, 1, 1'000}},
    {"--count", {&options::count, 1, 10'000'000}},
    {"--subscribers", {&options::subscribers, 1, 256}},
    {"--interval-us", {&options::interval_us, 1, 1'000'000}},
};

const std::map<std::string_view, mode> modes{
    {"exchange", mode::exchange}, {"task", mode::task}, {"fanout", mode::fan_out}};

std::uint32_t number(std::string_view option, std::string_view text, const bounded& limits) {
    std::uint32_t value = 0;
    const auto [end, wrong] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (wrong != std::errc{} || end != text.data() + text.size() || value < limits.least || value > limits.most) {
        throw std::invalid_argument(std::string{option} + " takes a number from " + std::to_string(limits.least) +
                                    " to " + std::to_string(limits.most));
    }
    return value;
}

} // namespace

const char* const usage = R"(  --mode exchange|task|fanout  what is measured (exchange)
  --over CARRIER               how both ends are linked; --about lists them
  --in-flight N                calls at a time (1)
  --count N                    calls, or publications (2000)
  --subscribers N              of a fan-out (1)
  --interval-us N              between its publications (1000)
  --spread                     let both ends run on all cores, instead of one core each
  --about                      only describes this peer
Prints a JSON object. The exit code is 77 if the peer does not offer the measurement.
)";

options read_options(std::span<char*> arguments) {
    options read;
    for (std::size_t i = 1; i < arguments.size(); ++i) {
        const std::string_view word = arguments[i];
        const auto value = [&] {
            if (++i == arguments.size()) {
                throw std::invalid_argument(std::string{word} + " takes a value");
            }
            return std::string_view{arguments[i]};
        };
        if (const auto found = numbers.find(word); found != numbers.end()) {
            read.*found->second.into = number(word, value(), found->second);
        } else if (word == "--mode") {
            const auto named = modes.find(value());
            if (named == modes.end()) {
                throw std::invalid_argument("--mode takes exchange, task or fanout");
            }
            read.mode = named->second;
        } else if (word == "--over") {
            read.over = value();
        } else if (word == "--spread") {
            read.spread = true;
        } else if (word == "--about") {
            read.only_about = true;
        } else if (word == "--help" || word == "-h") {
            read.help = true;
        } else {
            throw std::invalid_argument("'" + std::string{word} + "' is not an option; --help lists them");
        }
    }
    if (std::uint64_t{read.count} * read.subscribers > 20'000'000) {
        throw std::invalid_argument("--count times --subscribers are more than 20000000 deliveries");
    }
    return read;
}

} // namespace cles::perf::peers
