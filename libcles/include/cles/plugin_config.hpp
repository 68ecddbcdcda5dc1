// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>
#include <cles/setting_error.hpp>

#include <string>
#include <string_view>

/// The settings of a plugin. Not for applications.

namespace cles::detail {

/// The first member of the JSON object that C does not have; empty if there is none.
template <described_struct C>
std::string unknown_setting(std::string_view json) {
    json_reader reader{json};
    std::string_view key;
    std::string unknown;
    if (reader.begin_object()) {
        while (reader.next_key(key)) {
            if (!is_among(field_table<C>, key)) {
                return std::string{key};
            }
            reader.skip();
        }
    }
    return unknown;
}

/// Settings with a `check()` of their own, in addition to their types.
template <class C>
concept checked_settings = requires(const C& settings) {
    settings.check();
};

/// The path at the beginning of a conversion error: "limit" of "limit: expected a number"; empty if there is none.
inline std::string setting_named_in(std::string_view why) {
    const auto end = why.find(": ");
    const auto key = why.substr(0, end == std::string_view::npos ? 0 : end);
    return std::string{key.find(' ') == std::string_view::npos ? key : std::string_view{}};
}

/// Reads settings of type C. An unknown setting is an error, so that misspelt names are noticed.
/// \throws cles::setting_error, and what the settings' `check()` throws
template <class C>
C plugin_config(std::string_view json) {
    C config{};
    std::string why;
    if (!cles::from_json(json, config, &why)) {
        throw setting_error(setting_named_in(why), "its configuration is invalid: " + why);
    }
    if constexpr (described_struct<C>) {
        if (const auto unknown = detail::unknown_setting<C>(json); !unknown.empty()) {
            throw setting_error(unknown, "it has no setting '" + unknown + "'");
        }
    }
    if constexpr (checked_settings<C>) {
        config.check();
    }
    return config;
}

/// Checks that a plugin without settings was given none. \throws cles::setting_error
inline void expect_no_config(std::string_view json) {
    json_reader reader{json};
    std::string_view key;
    if (!reader.begin_object() || reader.next_key(key)) {
        throw setting_error(std::string{key}, "it has no settings, but was given some");
    }
}

} // namespace cles::detail
