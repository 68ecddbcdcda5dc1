// SPDX-License-Identifier: BSL-1.0
#include "options/common_options.hpp"

#include "options/duration.hpp"
#include "output/errors.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <charconv>

namespace tool {

void add_noun(CLI::App& command, std::string& noun, const std::string& others) {
    command.add_option("noun", noun, "NODE:TASK or NODE:TASK/PARAMETER...; NODE may be " + others)
        ->required()
        ->type_name("");
}

void add_timeout(CLI::App& command, std::optional<std::chrono::milliseconds>& limit, const std::string& default_value) {
    command
        .add_option_function<std::string>(
            "-t,--timeout", [&limit](const std::string& text) { limit = parse_positive_duration(text); },
            "How long to wait for a reply: 500ms, 2s, 1min, 1h, or seconds (default " + default_value + ")")
        ->type_name("TIME");
}

void add_count(CLI::App& command, std::uint64_t& count, const std::string& help) {
    command
        .add_option_function<std::string>(
            "-n,--count",
            [&count](const std::string& text) {
                const auto* end = text.data() + text.size();
                const auto [rest, code] = std::from_chars(text.data(), end, count);
                if (code != std::errc{} || rest != end) {
                    throw usage_error("--count '" + text + "' is not a whole number from 0 up");
                }
            },
            help)
        ->type_name("N");
}

void add_hops(CLI::App& command, std::uint32_t& most) {
    command.add_option("--hops", most, "How many nodes may forward the request (default 8, at most 16)")
        ->type_name("N")
        ->check(CLI::Range(0, 16).description(""));
}

void add_duration(CLI::App& command, const std::string& name, std::chrono::milliseconds& span,
                  const std::string& help) {
    command
        .add_option_function<std::string>(
            name, [&span](const std::string& text) { span = parse_duration(text); }, help)
        ->type_name("TIME");
}

void refuse_body(CLI::App& command, const std::string& verb) {
    command
        .add_option_function<std::string>("-d,--data",
                                          [verb](const std::string&) {
                                              throw usage_error(verb +
                                                                " takes no body: -d is for push, delegate and update");
                                          })
        ->group("");
}

} // namespace tool
