// SPDX-License-Identifier: BSL-1.0
// Conversions of every supported type, in both directions: text from anybody is read without a fault, and values of any
// bytes are written as JSON that is read back as the same value, or refused. The schema of a type and its reader accept
// the same texts.
#include <cles/convert.hpp>
#include <cles/convert_chrono.hpp>
#include <cles/convert_wrapped.hpp>
#include <cles/json_value.hpp>
#include <cles/schema.hpp>
#include <cles/type_schema.hpp>

#include "fuzz/fuzz.hpp"

#include <boost/describe.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <ratio>
#include <string>
#include <string_view>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <variant>
#include <vector>

namespace cles::fuzz {
namespace {

enum class colour : std::uint8_t { red, green };
BOOST_DESCRIBE_ENUM(colour, red, green)

enum class sensors : std::uint16_t { none = 0, gps = 1, imu = 2, lidar = 8 };
BOOST_DESCRIBE_ENUM(sensors, none, gps, imu, lidar)
[[maybe_unused]] constexpr sensors operator|(sensors a, sensors b) {
    return static_cast<sensors>(static_cast<unsigned>(a) | static_cast<unsigned>(b));
}

class hidden {
  public:
    hidden() = default;
    explicit hidden(float angle) : angle_(angle) {}

  private:
    float angle_ = 0;

    BOOST_DESCRIBE_CLASS(hidden, (), (), (), (angle_))
    friend CLES_NAMES(hidden, (angle_, "angle"))
};

struct alone {
    double value = 0;
};
BOOST_DESCRIBE_STRUCT(alone, (), (value))

struct measured {
    double value = 0;
    std::optional<std::string> unit;
    float error = 1;
};
BOOST_DESCRIBE_STRUCT(measured, (), (value, unit, error))
CLES_DEFAULTS(measured, (error))
CLES_FIELD(measured, value, "K", "temperature")

struct bounded {
    double lat = 0;
    float share = 0;
    std::int16_t gear = 0;
    std::optional<std::uint64_t> count;
};
BOOST_DESCRIBE_STRUCT(bounded, (), (lat, share, gear, count))
CLES_DEFAULTS(bounded, (gear))
CLES_FIELD(bounded, lat, "deg", "latitude", -90, 90)
CLES_FIELD(bounded, share, "", "", 0, 1)
CLES_FIELD(bounded, gear, "", "", -1, 6)
CLES_FIELD(bounded, count, "", "", 1, 1000)

struct tagged : measured {
    colour tag = colour::red;
    std::array<std::int16_t, 2> at{};
};
BOOST_DESCRIBE_STRUCT(tagged, (measured), (tag, at))

struct tree {
    bool leaf = false;
    std::vector<tree> below;
};
BOOST_DESCRIBE_STRUCT(tree, (), (leaf, below))

// As structs of C have it; written only.
struct labelled {
    char name[8] = {}; // NOLINT(modernize-avoid-c-arrays): it is what is tested
    std::uint32_t number = 0;
};
BOOST_DESCRIBE_STRUCT(labelled, (), (name, number))

// -- values of any bytes -------------------------------------------------------------------------------------------

/// The input as a source of values; zeros follow it.
class source {
  public:
    explicit source(std::string_view bytes) noexcept : left_(bytes) {}

    template <class T>
    T bits() {
        T made{};
        std::memcpy(&made, left_.data(), std::min(left_.size(), sizeof made));
        left_.remove_prefix(std::min(left_.size(), sizeof made));
        return made;
    }
    std::size_t below(std::size_t most) { return bits<std::uint8_t>() % most; }
    std::string_view text() {
        const std::size_t wanted = bits<std::uint8_t>(); // before what is left is asked for
        const auto size = std::min(wanted, left_.size());
        const auto made = left_.substr(0, size);
        left_.remove_prefix(size);
        return made;
    }

  private:
    std::string_view left_;
};

template <class T>
struct maker;

template <class T>
T make(source& from) {
    return maker<T>::make(from);
}

template <class T>
    requires(std::integral<T> || std::floating_point<T>)
struct maker<T> {
    static T make(source& from) { return from.bits<T>(); }
};
template <>
struct maker<bool> {
    static bool make(source& from) { return from.below(2) == 1; }
};
// Not all bits of a `long double` are a number.
template <>
struct maker<long double> {
    static long double make(source& from) {
        const auto factor = from.below(2) == 1 ? 1e10L : 1.0L;
        return from.bits<double>() * factor;
    }
};
template <>
struct maker<colour> {
    static colour make(source& from) { return from.below(2) == 1 ? colour::green : colour::red; }
};
template <>
struct maker<sensors> {
    static sensors make(source& from) { return from.bits<sensors>(); }
};
template <>
struct maker<hidden> {
    static hidden make(source& from) { return hidden{fuzz::make<float>(from)}; }
};
template <>
struct maker<alone> {
    static alone make(source& from) { return {fuzz::make<double>(from)}; }
};
template <>
struct maker<std::string> {
    static std::string make(source& from) { return std::string{from.text()}; }
};
template <>
struct maker<json_text> {
    static json_text make(source& from) { return std::string{from.text()}; }
};
template <>
struct maker<std::monostate> {
    static std::monostate make(source&) { return {}; }
};
template <>
struct maker<measured> {
    static measured make(source& from) {
        return {.value = fuzz::make<double>(from),
                .unit = fuzz::make<std::optional<std::string>>(from),
                .error = fuzz::make<float>(from)};
    }
};
template <>
struct maker<tagged> {
    static tagged make(source& from) {
        return {fuzz::make<measured>(from), fuzz::make<colour>(from), fuzz::make<std::array<std::int16_t, 2>>(from)};
    }
};
template <>
struct maker<bounded> {
    static bounded make(source& from) {
        return {.lat = fuzz::make<double>(from),
                .share = fuzz::make<float>(from),
                .gear = fuzz::make<std::int16_t>(from),
                .count = fuzz::make<std::optional<std::uint64_t>>(from)};
    }
};
template <>
struct maker<tree> {
    static tree make(source& from) {
        tree made{.leaf = fuzz::make<bool>(from), .below = {}};
        for (auto more = from.below(3); more != 0; --more) {
            made.below.push_back(fuzz::make<tree>(from));
        }
        return made;
    }
};
template <class T>
struct maker<std::optional<T>> {
    static std::optional<T> make(source& from) {
        return from.below(2) == 1 ? std::optional<T>{fuzz::make<T>(from)} : std::nullopt;
    }
};
template <class T>
struct maker<std::vector<T>> {
    static std::vector<T> make(source& from) {
        std::vector<T> made;
        for (auto more = from.below(4); more != 0; --more) {
            made.push_back(fuzz::make<T>(from));
        }
        return made;
    }
};
template <class T, std::size_t N>
struct maker<std::array<T, N>> {
    static std::array<T, N> make(source& from) {
        std::array<T, N> made{};
        for (auto& each : made) {
            each = fuzz::make<T>(from);
        }
        return made;
    }
};
template <class Map>
    requires requires { typename Map::mapped_type; }
struct maker<Map> {
    static Map make(source& from) {
        Map made;
        for (auto more = from.below(4); more != 0; --more) {
            auto key = fuzz::make<typename Map::key_type>(from);
            made.insert_or_assign(std::move(key), fuzz::make<typename Map::mapped_type>(from));
        }
        return made;
    }
};
template <class T, class U>
struct maker<std::pair<T, U>> {
    static std::pair<T, U> make(source& from) {
        auto first = fuzz::make<T>(from);
        return {std::move(first), fuzz::make<U>(from)};
    }
};
template <class... T>
struct maker<std::tuple<T...>> {
    static std::tuple<T...> make(source& from) { return std::tuple<T...>{fuzz::make<T>(from)...}; }
};
template <class... T>
struct maker<std::variant<T...>> {
    static std::variant<T...> make(source& from) {
        std::variant<T...> made;
        const auto which = from.below(sizeof...(T));
        std::size_t index = 0;
        ((index++ == which ? static_cast<void>(made = fuzz::make<T>(from)) : void()), ...);
        return made;
    }
};
template <class Rep, class Period>
struct maker<std::chrono::duration<Rep, Period>> {
    static std::chrono::duration<Rep, Period> make(source& from) {
        return std::chrono::duration<Rep, Period>{fuzz::make<Rep>(from)};
    }
};
template <class Duration>
struct maker<std::chrono::sys_time<Duration>> {
    static std::chrono::sys_time<Duration> make(source& from) {
        return std::chrono::sys_time<Duration>{fuzz::make<Duration>(from)};
    }
};
template <>
struct maker<boost::json::value> {
    static boost::json::value make(source& from) {
        switch (from.below(6)) {
        case 0: return nullptr;
        case 1: return fuzz::make<bool>(from);
        case 2: return fuzz::make<std::int64_t>(from);
        case 3: return fuzz::make<std::uint64_t>(from);
        case 4: {
            const auto text = from.text();
            return boost::json::string(text.data(), text.size());
        }
        default: {
            boost::json::array made;
            for (auto more = from.below(3); more != 0; --more) {
                made.push_back(fuzz::make<boost::json::value>(from));
            }
            return made;
        }
        }
    }
};

/// Whether what is written is read back as the same text: not if seconds are a fraction of the value's unit, or members
/// are in no order.
template <class T>
inline constexpr bool is_exact = true;
template <std::floating_point Rep, class Period>
inline constexpr bool is_exact<std::chrono::duration<Rep, Period>> = std::ratio_equal_v<Period, std::ratio<1>>;
template <std::floating_point Rep, class Period>
inline constexpr bool is_exact<std::chrono::sys_time<std::chrono::duration<Rep, Period>>> = false;

template <class Key, class Value>
inline constexpr bool is_exact<std::unordered_map<Key, Value>> = false;

/// Whether its schema tells what its reader accepts.
template <class T>
inline constexpr bool is_told = !std::is_same_v<T, boost::json::value>;

// -- the properties ------------------------------------------------------------------------------------------------

/// Nothing if the value is refused.
template <class T>
std::optional<std::string> written(const T& value) {
    std::string text;
    try {
        text = to_json(value);
    } catch (const error& e) {
        require(e.code() == errc::conversion, "a value is refused as such", e.what());
        return std::nullopt;
    }
    std::string why;
    require(is_valid_json(text, json_writer::most_levels, &why), "what is written is JSON that readers accept", why);
    require(text.find('\n') == std::string::npos, "what is written is one line", text);
    return text;
}

template <class T>
const schema& schema_of_type() {
    static const schema made{[] {
        detail::schema_writer writer;
        detail::write_schema<T>(writer);
        return writer.finish();
    }()};
    return made;
}

/// \tparam T what is read, \tparam Told whose schema it is
template <class T, class Told = T>
void check_agreement(std::string_view text) {
    if constexpr (is_told<T>) {
        T read{};
        std::string why;
        const bool is_read = from_json(text, read, &why);
        const auto mismatch = schema_of_type<Told>().mismatch(text);
        require(is_read == mismatch.empty(), "reader and schema agree",
                std::string{text} + ": reader: " + why + "; schema: " + mismatch);
    }
}

/// Other texts: one value of `text` is replaced, or left out.
template <class Check>
void with_near_misses(std::string_view text, Check check) {
    check(text);
    constexpr std::size_t most = 3; // places, which differ with the size of the text
    const auto skipped = text.size() % most;
    std::size_t places = 0;
    for (std::size_t at = 0; at < text.size() && places < skipped + most; ++at) {
        if (std::string_view{":[,"}.find(text[at]) == std::string_view::npos || places++ < skipped) {
            continue;
        }
        const auto begin = at + 1;
        const auto end = std::min(text.find_first_of(",]}", begin), text.size());
        for (const std::string_view other :
             {"null", "true", "-1", "0", "1.5", "1e300", "1e999", "300", "18446744073709551615", "\"red\"", "\"PT1S\"",
              "\"2026-01-01T00:00:00Z\"", "{}", "[]", "{\"value\":1}"}) {
            check(std::string{text.substr(0, begin)}.append(other).append(text.substr(end)));
        }
    }
    check(std::string{"{"}.append(text.substr(std::min(text.find(',') + 1, text.size()))));
}

template <class T>
void check_written(const T& value) {
    const auto text = written(value);
    if (!text) {
        return;
    }
    if (!is_valid_json(*text)) { // deep, which only readers of results accept
        return;
    }
    T again{};
    std::string why;
    require(from_json(*text, again, &why), "what is written can be read", *text + ": " + why);
    with_near_misses(*text, [](std::string_view near) { check_agreement<T>(near); });
    require(!is_exact<T> || written(again) == text, "it is written the same", *text);

    using carrier = std::conditional_t<detail::comes_wrapped<T>, detail::wrapped<T>, T>;
    const auto body = detail::to_body(value);
    require(body.starts_with('{') || body.starts_with('['), "a body is an object or an array", body);
    with_near_misses(body, [](std::string_view near) {
        if constexpr (is_told<T>) {
            check_agreement<carrier, detail::content<T>>(near);
        }
    });
    carrier carried{};
    require(from_json(body, carried, &why), "a body can be read", body + ": " + why);
    if constexpr (detail::comes_wrapped<T>) {
        require(!is_exact<T> || written(carried.value) == text, "a body is read as what was written", body);
    }
}

template <class T>
void check(std::string_view input) {
    T read{};
    std::string why;
    check_agreement<T>(input);
    if (from_json(input, read, &why)) {
        check_written(read);
    } else {
        require(why.find("(at byte ") != std::string::npos, "a refusal says where", why);
    }
    source bytes{input};
    check_written(fuzz::make<T>(bytes));
}

template <class... T>
void check_all(std::string_view input) {
    (check<T>(input), ...);
}

void check_text_of_c(std::string_view input) {
    source bytes{input};
    auto made = labelled{.name = {}, .number = 0};
    const auto name = bytes.bits<std::array<char, sizeof made.name>>();
    std::memcpy(made.name, name.data(), sizeof made.name);
    made.number = bytes.bits<std::uint32_t>();
    if (const auto text = written(made)) {
        const std::string_view whole{name.data(), name.size()};
        const auto used = whole.substr(0, whole.find('\0'));
        require(*text == "{\"name\":" + to_json(used) + ",\"number\":" + to_json(made.number) + "}",
                "an array of char is text up to its end", *text);
    }
    const auto text = std::string{bytes.text()};
    static_cast<void>(written(std::string_view{text}));
    static_cast<void>(written(text.c_str()));
    static_cast<void>(written(static_cast<const char*>(nullptr)));
}

} // namespace

void run(std::string_view input) {
    namespace chrono = std::chrono;
    check_all<bool, signed char, unsigned char, short, unsigned short, int, unsigned, long, unsigned long, long long,
              unsigned long long>(input);
    check_all<char, char8_t, char16_t, char32_t, wchar_t>(input);
    check_all<float, double, long double, std::string, json_text, colour, sensors>(input);
    check_all<measured, tagged, bounded, tree, hidden>(input);
    check_all<std::map<std::int16_t, bool>, std::unordered_map<char, bool>, std::map<sensors, double>>(input);
    check_all<std::variant<alone, double>, std::optional<std::map<std::string, std::optional<double>>>,
              std::variant<std::map<std::string, alone>, alone, bool, double>>(input);
    check_all<std::vector<std::string>, std::vector<bool>, std::array<double, 2>, std::pair<int, std::string>,
              std::tuple<bool, float, std::vector<int>>, std::map<std::string, tagged>,
              std::unordered_map<std::string, std::int8_t>>(input);
    check_all<std::optional<int>, std::optional<measured>, std::monostate,
              std::variant<std::monostate, bool, double, std::string, std::vector<double>, measured>>(input);
    check_all<chrono::nanoseconds, chrono::microseconds, chrono::milliseconds, chrono::seconds, chrono::minutes,
              chrono::hours, chrono::duration<std::int32_t, std::milli>, chrono::duration<std::uint8_t>,
              chrono::duration<std::int64_t, std::pico>, chrono::duration<std::int64_t, std::exa>>(input);
    check_all<chrono::duration<double>, chrono::duration<float>, chrono::duration<double, std::nano>,
              chrono::duration<double, std::exa>, chrono::duration<float, std::ratio<3600>>>(input);
    check_all<chrono::sys_seconds, chrono::sys_time<chrono::nanoseconds>, chrono::sys_time<chrono::milliseconds>,
              chrono::sys_time<chrono::duration<double>>>(input);
    check_all<boost::json::value>(input);
    check_text_of_c(input);
}

} // namespace cles::fuzz
