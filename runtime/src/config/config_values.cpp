// SPDX-License-Identifier: BSL-1.0
#include "config/config_values.hpp"

#include <cles/error.hpp>
#include <cles/link.hpp>
#include <cles/url.hpp>

#include <boost/asio/ip/network_v4.hpp>
#include <boost/asio/ip/network_v6.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <utility>

namespace cles::runtime {
namespace {

using std::chrono::microseconds;

[[noreturn]] void refuse(std::string_view text, const std::string& why) {
    throw invalid_value("'" + std::string{text} + "' " + why);
}

// Reads the number at the beginning of the text, and removes it from `text`.
template <class T>
bool take_number(std::string_view& text, T& number) {
    const auto* end = text.data() + text.size();
    const auto [rest, code] = std::from_chars(text.data(), end, number);
    text.remove_prefix(static_cast<std::size_t>(rest - text.data()));
    return code == std::errc{};
}

std::uint64_t within(std::string_view text, std::uint64_t number, std::uint64_t min, std::uint64_t max) {
    if (number < min || number > max) {
        refuse(text, "is not a number from " + std::to_string(min) + " to " + std::to_string(max));
    }
    return number;
}

constexpr std::array<std::pair<std::string_view, std::uint64_t>, 4> sizes{
    {{"", 1}, {"KiB", 1U << 10U}, {"MiB", 1U << 20U}, {"GiB", 1U << 30U}}};

// Largest first.
constexpr std::array<std::pair<std::string_view, std::int64_t>, 5> units{
    {{"h", 3'600'000'000}, {"min", 60'000'000}, {"s", 1'000'000}, {"ms", 1'000}, {"us", 1}}};
constexpr microseconds max_duration = std::chrono::hours{24};

constexpr std::array<std::pair<std::string_view, log_level>, 4> levels{{{"debug", log_level::debug},
                                                                        {"info", log_level::info},
                                                                        {"warning", log_level::warning},
                                                                        {"error", log_level::error}}};

// Calls a function of the library, and converts its errors.
template <class F>
auto translate_errors(F read) {
    try {
        return read();
    } catch (const error& e) {
        throw invalid_value(e.message());
    }
}

} // namespace

bool to_bool(std::string_view text) {
    if (text == "true" || text == "on" || text == "yes") {
        return true;
    }
    if (text == "false" || text == "off" || text == "no") {
        return false;
    }
    refuse(text, "is neither true nor false");
}

std::uint64_t to_count(std::string_view text, std::uint64_t min, std::uint64_t max) {
    auto rest = text;
    std::uint64_t number = 0;
    if (!take_number(rest, number) || !rest.empty()) {
        refuse(text, "is not a number from " + std::to_string(min) + " to " + std::to_string(max));
    }
    return within(text, number, min, max);
}

std::uint64_t to_size(std::string_view text, std::uint64_t min, std::uint64_t max) {
    auto rest = text;
    std::uint64_t number = 0;
    const bool is_number = take_number(rest, number);
    const auto* const unit = std::ranges::find(sizes, rest, &decltype(sizes)::value_type::first);
    if (!is_number || unit == sizes.end()) {
        refuse(text, "is not a size: write bytes, or 64KiB, 1MiB, 1GiB");
    }
    return within(text, number > max / unit->second ? max + 1 : number * unit->second, min, max);
}

microseconds to_duration(std::string_view text) {
    auto rest = text;
    double number = 0;
    const bool is_number = take_number(rest, number) && std::isfinite(number) && !std::signbit(number);
    if (is_number && number == 0 && rest.empty()) {
        return microseconds{0};
    }
    const auto* const unit = std::ranges::find(units, rest, &decltype(units)::value_type::first);
    if (!is_number || unit == units.end()) {
        refuse(text, "is not a duration: write 50us, 250ms, 2s, 1min or 1h");
    }
    const double span = number * static_cast<double>(unit->second);
    if (span > static_cast<double>(max_duration.count())) {
        refuse(text, "is more than a day");
    }
    return microseconds{number > 0 ? std::max(std::llround(span), 1LL) : 0}; // 0 has a special meaning
}

std::optional<microseconds> to_wake_within(std::string_view text) {
    if (text == "off") {
        return std::nullopt;
    }
    if (text == "0") {
        refuse(text, "is ambiguous: write off, or 0us to keep the cores awake");
    }
    return to_duration(text);
}

std::string wake_within_text(std::optional<microseconds> bound) {
    if (!bound) {
        return "off";
    }
    return *bound == microseconds{0} ? "0us" : to_string(*bound);
}

namespace {

bool is_name(std::string_view text) {
    return !text.empty() && text.size() <= 64 && std::ranges::all_of(text, [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
               c == '.';
    });
}

} // namespace

std::string to_pool_name(std::string_view text) {
    if (!text.empty() && !is_name(text)) {
        refuse(text, "is not a valid pool name (1 to 64 letters, digits, '_', '-', '.')");
    }
    return std::string{text};
}

std::string to_federated_pool_name(std::string_view text) {
    constexpr std::size_t longest = 32;
    if (!is_name(text) || text.size() > longest || text.find('.') != std::string_view::npos || text == "self" ||
        text == "any" || text == "all") {
        refuse(text, "is not a valid name of a pool that others reach (1 to 32 letters, digits, '_', '-')");
    }
    return std::string{text};
}

std::string to_nats_url(std::string_view text) {
    const auto host = text.substr(std::min(text.find("://"), text.size()));
    constexpr std::size_t shortest = 4;
    if ((!text.starts_with("nats://") && !text.starts_with("tls://")) || host.size() < shortest ||
        text.find_first_of(" \t,") != std::string_view::npos) {
        refuse(text, "is not the URL of a NATS server, as in nats://host:4222");
    }
    return std::string{text};
}

std::string to_node_name(std::string_view text) {
    if (!is_name(text)) {
        refuse(text, "is not a valid node name (1 to 64 letters, digits, '_', '-', '.')");
    }
    if (text == "self" || text == "any" || text == "all") {
        refuse(text, "is not a valid node name, because every node answers to it");
    }
    return std::string{text};
}

std::string to_url(std::string_view text) {
    const auto where = translate_errors([&] { return parse_url(text); });
    if (where.scheme == "inproc") {
        refuse(text, "cannot be reached from outside the process");
    }
    if (find_transport(where.scheme) == nullptr && where.scheme != "tls") { // which `security` adds
        refuse(text, "has an unknown scheme");
    }
    return std::string{text};
}

std::string to_network(std::string_view text) {
    boost::system::error_code not_v4;
    boost::system::error_code not_v6;
    boost::asio::ip::make_network_v4(text, not_v4);
    boost::asio::ip::make_network_v6(text, not_v6);
    if (not_v4 && not_v6) {
        refuse(text, "is not a network: write 10.0.0.0/8 or fd00::/8");
    }
    return std::string{text};
}

multicast_options to_multicast(std::string_view text) {
    return translate_errors([&] { return parse_multicast(text); });
}

std::string to_interfaces(std::string_view text) {
    if (text.empty() || text == "off") {
        refuse(text, "is not an interface; 'multicast: off' turns multicast off");
    }
    multicast_options where{.interface = std::string{text}};
    translate_errors([&] { check(where); });
    return std::move(where.interface);
}

bool to_isolated(std::string_view text) {
    if (text != "process" && text != "none") {
        refuse(text, "is neither process nor none");
    }
    return text == "process";
}

std::string to_absolute_path(std::string_view text) {
    if (!text.starts_with('/')) {
        refuse(text, "is not an absolute path, which begins with '/'");
    }
    return std::string{text};
}

std::string to_sha256(std::string_view text) {
    constexpr std::size_t digits = 64;
    constexpr std::string_view small = "0123456789abcdef";
    constexpr std::string_view capital = "0123456789ABCDEF";
    std::string read;
    for (const char c : text) {
        const auto value = std::min(small.find(c), capital.find(c));
        if (value == std::string_view::npos) {
            break;
        }
        read.push_back(small[value]);
    }
    if (text.size() != digits || read.size() != digits) {
        refuse(text, "is not a SHA-256: write the 64 hexadecimal digits that sha256sum prints");
    }
    return read;
}

log_level to_log_level(std::string_view text) {
    const auto* const found = std::ranges::find(levels, text, &decltype(levels)::value_type::first);
    if (found == levels.end()) {
        refuse(text, "is not one of debug, info, warning, error");
    }
    return found->second;
}

log_format to_log_format(std::string_view text) {
    if (text == "text") {
        return log_format::text;
    }
    if (text == "json") {
        return log_format::json;
    }
    refuse(text, "is neither text nor json");
}

log_config to_log_config(std::string_view text, log_config current) {
    const auto whole = text;
    for (bool more = true; more;) {
        const auto comma = text.find(',');
        const auto part = text.substr(0, comma);
        if (part == "text" || part == "json") {
            current.format = to_log_format(part);
        } else if (std::ranges::find(levels, part, &decltype(levels)::value_type::first) != levels.end()) {
            current.level = to_log_level(part);
        } else {
            refuse(
                whole,
                "is not a log setting: write debug, info, warning, error, text, json, or two of them, as debug,json");
        }
        more = comma != std::string_view::npos;
        text.remove_prefix(more ? comma + 1 : text.size());
    }
    return current;
}

std::string_view to_string(log_level level) noexcept {
    return std::ranges::find(levels, level, &decltype(levels)::value_type::second)->first;
}

std::string_view to_string(log_format format) noexcept { return format == log_format::json ? "json" : "text"; }

std::string to_string(microseconds span) {
    for (const auto& [unit, length] : units) {
        if (span.count() != 0 && span.count() % length == 0) {
            return std::to_string(span.count() / length) + std::string{unit};
        }
    }
    return "0";
}

} // namespace cles::runtime
