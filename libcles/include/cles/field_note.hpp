// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <limits>
#include <string_view>

/// States the unit, the meaning and the range of a member of a described struct. Write it after the description of the
/// struct, in the struct's namespace (or inside the struct, after `friend`):
///
///     struct position {
///         double lat = 0;
///         double lon = 0;
///         float speed = 0;
///     };
///     BOOST_DESCRIBE_STRUCT(position, (), (lat, lon, speed))
///     CLES_FIELD(position, lat, "deg", "latitude, WGS 84", -90, 90)
///     CLES_FIELD(position, lon, "deg", "longitude, WGS 84", -180, 180)
///     CLES_FIELD(position, speed, "m/s")
///
/// Unit and meaning are texts, either of which may be "". They are shown to people (`cles info`), and cost nothing in a
/// program that does not tell its types (<cles/types.hpp>). The range, which is of a number or of an optional one, is
/// checked: a number outside is neither read nor written.
#define CLES_FIELD(type, member, ...)                                                                                  \
    constexpr ::cles::field_note cles_note_of_member(const type*,                                                      \
                                                     ::cles::detail::member_tag<&type::member>) noexcept {             \
        return {__VA_ARGS__};                                                                                          \
    }

namespace cles {

/// What `CLES_FIELD` states.
struct field_note {
    std::string_view unit{};
    std::string_view meaning{};
    double minimum = std::numeric_limits<double>::lowest();
    double maximum = std::numeric_limits<double>::max();

    [[nodiscard]] constexpr bool has_range() const noexcept {
        return minimum != std::numeric_limits<double>::lowest() || maximum != std::numeric_limits<double>::max();
    }
};

namespace detail {
template <auto Member>
struct member_tag {};
} // namespace detail

} // namespace cles
