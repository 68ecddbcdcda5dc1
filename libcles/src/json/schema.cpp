// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>
#include <cles/convert_chrono.hpp>
#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/json_value.hpp>
#include <cles/schema.hpp>

#include <boost/json/array.hpp>
#include <boost/json/object.hpp>
#include <boost/json/value.hpp>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

namespace cles {

struct schema::content {
    boost::json::value root;
};

namespace {

using boost::json::array;
using boost::json::object;
using boost::json::value;
using kind = json_reader::kind;

constexpr std::size_t longest_types = 65536;
constexpr std::size_t deepest_types = 30; // replies put it into two more objects

std::string_view view(boost::json::string_view text) { return {text.data(), text.size()}; }

const value* find(const object& in, std::string_view name) {
    return in.if_contains(boost::json::string_view{name.data(), name.size()});
}
const object* find_object(const object& in, std::string_view name) {
    const auto* found = find(in, name);
    return found != nullptr ? found->if_object() : nullptr;
}
const array* find_array(const object& in, std::string_view name) {
    const auto* found = find(in, name);
    return found != nullptr ? found->if_array() : nullptr;
}
std::string_view text_in(const value& of) { return of.is_string() ? view(of.get_string()) : std::string_view{}; }
std::string_view find_text(const object& in, std::string_view name) {
    const auto* found = find(in, name);
    return found != nullptr ? text_in(*found) : std::string_view{};
}

bool is_count(const value& of) { return of.is_uint64() || (of.is_int64() && of.get_int64() >= 0); }
std::uint64_t count_in(const value& of) {
    return of.is_uint64() ? of.get_uint64() : static_cast<std::uint64_t>(of.get_int64());
}
std::optional<std::uint64_t> find_count(const object& in, std::string_view name) {
    const auto* found = find(in, name);
    return found != nullptr && is_count(*found) ? std::optional{count_in(*found)} : std::nullopt;
}
std::int64_t find_integer(const object& in, std::string_view name) {
    const auto* found = find(in, name);
    return found != nullptr && found->is_int64() ? found->get_int64() : 0;
}

// A long double holds all integers of 64 bits.
long double number_in(const value& of) {
    if (of.is_int64()) {
        return static_cast<long double>(of.get_int64());
    }
    return of.is_uint64() ? static_cast<long double>(of.get_uint64()) : static_cast<long double>(of.get_double());
}

/// The schema that "#" or "#/$defs/name" refers to; null if there is none.
const value* resolve(const value& root, std::string_view reference) {
    constexpr std::string_view definitions = "#/$defs/";
    if (reference == "#") {
        return &root;
    }
    const auto* all = root.is_object() ? find_object(root.get_object(), "$defs") : nullptr;
    return all != nullptr && reference.starts_with(definitions) ? find(*all, reference.substr(definitions.size()))
                                                                : nullptr;
}

// -- whether a text is a schema ------------------------------------------------------------------------------------

enum class form {
    schema,
    schemas,
    named_schemas,
    types,
    text,
    texts,
    number,
    count,
    counts,
    scalar,
    scalars,
    ticks,
    reference,
    any
};

struct keyword {
    std::string_view name;
    form takes;
};

constexpr std::array<keyword, 30> keywords{{{"type", form::types},
                                            {"enum", form::scalars},
                                            {"const", form::scalar},
                                            {"minimum", form::number},
                                            {"maximum", form::number},
                                            {"format", form::text},
                                            {"ticks", form::ticks},
                                            {"flags", form::counts},
                                            {"properties", form::named_schemas},
                                            {"required", form::texts},
                                            {"additionalProperties", form::schema},
                                            {"propertyNames", form::schema},
                                            {"maxProperties", form::count},
                                            {"items", form::schema},
                                            {"prefixItems", form::schemas},
                                            {"minItems", form::count},
                                            {"maxItems", form::count},
                                            {"anyOf", form::schemas},
                                            {"allOf", form::schemas},
                                            {"$ref", form::reference},
                                            {"$defs", form::named_schemas},
                                            {"$schema", form::text},
                                            {"$comment", form::text},
                                            {"title", form::text},
                                            {"description", form::text},
                                            {"unit", form::text},
                                            {"default", form::any},
                                            {"examples", form::any},
                                            {"deprecated", form::any},
                                            {"readOnly", form::any}}};

constexpr std::array<std::string_view, 7> type_names{"object",  "array",   "string", "number",
                                                     "integer", "boolean", "null"};

bool is_type_name(const value& of) {
    return of.is_string() && std::ranges::find(type_names, text_in(of)) != type_names.end();
}

template <class Test>
bool all_of(const value& list, Test test) {
    const auto* elements = list.if_array();
    return elements != nullptr && std::all_of(elements->begin(), elements->end(), test);
}
template <class Test>
bool some_all_of(const value& list, Test test) {
    return all_of(list, test) && !list.get_array().empty();
}

/// Throws if a value is no schema of the subset.
class schema_check {
  public:
    explicit schema_check(const value& root) : root_(root) {}

    void check(const value& what, const std::string& where) {
        if (what.is_bool()) {
            return;
        }
        const auto* members = what.if_object();
        if (members == nullptr) {
            fail(where, "a schema is an object, true or false");
        }
        for (const auto& member : *members) {
            check_member(view(member.key()), member.value(), where);
        }
    }

  private:
    [[noreturn]] static void fail(const std::string& where, const std::string& why) {
        throw error(errc::conversion, "not a schema of the subset: " + (where.empty() ? "" : where + ": ") + why);
    }

    void check_member(std::string_view name, const value& held, const std::string& outer) {
        const auto where = outer.empty() ? std::string{name} : outer + "." + std::string{name};
        if (name.starts_with("x-")) {
            return;
        }
        const auto* const known = std::ranges::find(keywords, name, &keyword::name);
        if (known == keywords.end()) {
            fail(where, "this keyword is not in the subset (docs/protocol.md, \"Types\")");
        }
        if (name == "$defs" && !outer.empty()) {
            fail(where, "definitions are those of the whole schema");
        }
        if (!is_well_formed(known->takes, held, where)) {
            fail(where, "its value has another form");
        }
    }

    bool is_well_formed(form wanted, const value& held, const std::string& where) {
        const auto is_text = [](const value& each) { return each.is_string(); };
        const auto is_scalar = [](const value& each) { return !each.is_object() && !each.is_array(); };
        switch (wanted) {
        case form::schema: check(held, where); return true;
        case form::schemas: return some_all_of(held, [&](const value& each) { return is_schema(each, where); });
        case form::named_schemas: return are_schemas(held, where);
        case form::types: return is_type_name(held) || some_all_of(held, is_type_name);
        case form::text: return held.is_string();
        case form::texts: return all_of(held, is_text);
        case form::number: return held.is_number();
        case form::count: return is_count(held);
        case form::counts: return all_of(held, is_count);
        case form::scalar: return is_scalar(held);
        case form::scalars: return some_all_of(held, is_scalar);
        case form::ticks: return are_ticks(held);
        case form::reference: return resolve(root_, text_in(held)) != nullptr;
        case form::any: return true;
        }
        return false;
    }

    bool is_schema(const value& held, const std::string& where) {
        check(held, where);
        return true;
    }
    bool are_schemas(const value& held, const std::string& where) {
        const auto* members = held.if_object();
        if (members == nullptr) {
            return false;
        }
        for (const auto& member : *members) {
            check(member.value(), where + "." + std::string{view(member.key())});
        }
        return true;
    }
    static bool are_ticks(const value& held) {
        const auto* unit = held.if_object();
        return unit != nullptr && find_integer(*unit, "num") > 0 && find_integer(*unit, "den") > 0;
    }

    const value& root_;
};

// -- whether a value fits ------------------------------------------------------------------------------------------

std::string_view name_of(kind what) noexcept {
    switch (what) {
    case kind::object: return "an object";
    case kind::array: return "an array";
    case kind::string: return "a string";
    case kind::number: return "a number";
    case kind::boolean: return "a boolean";
    case kind::null: return "null";
    case kind::invalid: break;
    }
    return "no JSON";
}
std::string_view name_of(std::string_view type) noexcept {
    return type == "object"    ? "an object"
           : type == "array"   ? "an array"
           : type == "string"  ? "a string"
           : type == "number"  ? "a number"
           : type == "integer" ? "an integer"
           : type == "boolean" ? "a boolean"
                               : "null";
}

kind kind_of(std::string_view json) noexcept { return json_reader{json}.peek(); }

constexpr auto any_depth = std::string_view::npos; // it has been checked

// An integer as readers take it: without fraction and exponent, and without the sign of -0 if none may be negative.
std::optional<long double> integer_of(std::string_view digits, bool is_unsigned) {
    const auto read = [&](auto number) -> std::optional<long double> {
        const auto* const end = digits.data() + digits.size();
        const auto [last, wrong] = std::from_chars(digits.data(), end, number);
        return wrong == std::errc{} && last == end ? std::optional{static_cast<long double>(number)} : std::nullopt;
    };
    if (!is_unsigned) {
        if (const auto number = read(std::int64_t{})) {
            return number;
        }
    }
    return read(std::uint64_t{});
}

std::string without_position(std::string why) {
    why.resize(std::min(why.size(), why.rfind(" (at byte")));
    return why;
}

/// Compares one JSON text with a schema.
class matcher {
  public:
    explicit matcher(const value& root) noexcept : root_(root) {}

    bool fits(std::string_view json, const value& wanted, int references = 0) {
        constexpr std::size_t most_steps = 4'000'000; // more than the longest body needs, and at most seconds
        constexpr std::size_t bytes_in_a_step = 256;
        constexpr int most_references = 32;
        steps_ += 1 + json.size() / bytes_in_a_step; // the text is read again
        if (steps_ > most_steps) {
            return fail("there is too much to check");
        }
        if (const auto* all = wanted.if_bool()) {
            return *all || fail("is not allowed");
        }
        const auto& s = wanted.get_object();
        if (const auto reference = find_text(s, "$ref"); !reference.empty()) {
            if (references >= most_references) {
                return fail("the schema refers to itself");
            }
            if (!fits(json, *resolve(root_, reference), references + 1)) {
                return false;
            }
        }
        const auto what = kind_of(json);
        return fits_type(json, what, s) && fits_choice(json, what, s) && fits_scalar(json, what, s) &&
               (what != kind::object || fits_object(json, s)) && (what != kind::array || fits_array(json, s)) &&
               fits_all(json, s, references) && fits_any(json, s, references);
    }
    [[nodiscard]] std::string take_reason() noexcept { return std::move(why_); }

  private:
    bool fail(std::string_view why) {
        why_ = path_.empty() ? std::string{why} : path_ + ": " + std::string{why};
        return false;
    }

    // The schemas of what is inside.
    bool fits_inside(std::string_view json, const value& wanted, std::string_view step) {
        const auto before = path_.size();
        path_.append(path_.empty() || step.starts_with('[') ? "" : ".").append(step);
        if (!fits(json, wanted)) {
            return false;
        }
        path_.resize(before);
        return true;
    }

    static bool is_unsigned(const object& s) {
        const auto* least = find(s, "minimum");
        return least != nullptr && least->is_number() && number_in(*least) >= 0;
    }

    static bool has_type(std::string_view json, kind what, std::string_view type, const object& s) {
        json_reader r{json, any_depth};
        switch (what) {
        case kind::object: return type == "object";
        case kind::array: return type == "array";
        case kind::boolean: return type == "boolean";
        case kind::null: return type == "null";
        case kind::string: {
            std::string_view text;
            return type == "string" && r.read(text);
        }
        case kind::number: {
            std::string_view digits;
            double number = 0;
            return type == "integer" ? r.read_raw(digits) && integer_of(digits, is_unsigned(s)).has_value()
                                     : type == "number" && (find(s, "ticks") != nullptr || r.read(number));
        }
        case kind::invalid: break;
        }
        return false;
    }

    bool fits_type(std::string_view json, kind what, const object& s) {
        const auto* type = find(s, "type");
        if (type == nullptr) {
            return true;
        }
        if (type->is_string()) {
            return has_type(json, what, text_in(*type), s) || fail_type({text_in(*type)}, what);
        }
        std::vector<std::string_view> names;
        for (const auto& each : type->get_array()) {
            if (has_type(json, what, text_in(each), s)) {
                return true;
            }
            names.push_back(text_in(each));
        }
        return fail_type(names, what);
    }
    bool fail_type(const std::vector<std::string_view>& wanted, kind got) {
        std::string why = "expected ";
        for (const auto each : wanted) {
            why.append(each == wanted.front() ? "" : " or ").append(name_of(each));
        }
        return fail(why.append(", got ").append(name_of(got)));
    }

    static bool equals(std::string_view json, kind what, const value& one) {
        json_reader r{json, any_depth};
        switch (what) {
        case kind::string: {
            std::string_view text;
            return one.is_string() && r.read(text) && text == text_in(one);
        }
        case kind::number: {
            value number;
            return one.is_number() && from_json(json, number) && number_in(number) == number_in(one);
        }
        case kind::boolean: {
            bool flag = false;
            return one.is_bool() && r.read(flag) && flag == one.get_bool();
        }
        case kind::null: return one.is_null();
        default: return false;
        }
    }

    bool fits_choice(std::string_view json, kind what, const object& s) {
        const auto is_it = [&](const value& one) { return equals(json, what, one); };
        if (const auto* one = find(s, "const"); one != nullptr && !is_it(*one)) {
            return fail("expected " + to_json(*one));
        }
        const auto* choices = find_array(s, "enum");
        if (choices == nullptr) {
            return true;
        }
        constexpr std::size_t choices_in_a_step = 16;
        steps_ += choices->size() / choices_in_a_step;
        if (std::any_of(choices->begin(), choices->end(), is_it)) {
            return true;
        }
        std::string why = "expected one of ";
        const auto* before = "";
        for (const auto& each : *choices) {
            why.append(std::exchange(before, ", "))
                .append(each.is_string() ? std::string{text_in(each)} : to_json(each));
        }
        return fail(why);
    }

    bool fits_scalar(std::string_view json, kind what, const object& s) {
        const auto format = find_text(s, "format");
        if (const auto* unit = find_object(s, "ticks");
            unit != nullptr && what != kind::object && what != kind::array) {
            return fits_time(json, format == "duration", *unit);
        }
        std::string_view digits = json;
        json_reader r{json, any_depth};
        std::optional<long double> number;
        if (what == kind::string && format == "integer") {
            std::string_view text;
            if (!r.read(text)) {
                return fail("expected text");
            }
            const bool is_canonical =
                text == "0" || text.find_first_not_of('-') == text.find_first_of("123456789"); // no other text
            number = is_canonical ? integer_of(text, is_unsigned(s)) : std::nullopt;
            if (!number) {
                return fail("the key is not an integer");
            }
        } else if (what != kind::number) {
            return true;
        } else if (format == "float") {
            float small = 0;
            if (!r.read(small)) {
                return fail(without_position(r.error()));
            }
            number = static_cast<long double>(small);
        } else if (find(s, "minimum") != nullptr || find(s, "maximum") != nullptr || find(s, "flags") != nullptr) {
            r.read_raw(digits);
            number = integer_of(digits, false);
            double real = 0;
            if (json_reader other{digits}; !number && other.read(real)) {
                number = static_cast<long double>(real);
            }
        }
        return !number || (fits_range(*number, s) && fits_flags(*number, what, s));
    }

    bool fits_range(long double number, const object& s) {
        const auto* least = find(s, "minimum");
        const auto* most = find(s, "maximum");
        if ((least == nullptr || number >= number_in(*least)) && (most == nullptr || number <= number_in(*most))) {
            return true;
        }
        return fail("outside of its range, " + (least != nullptr ? to_json(*least) : std::string{"any"}) + " to " +
                    (most != nullptr ? to_json(*most) : std::string{"any"}));
    }

    bool fits_flags(long double number, kind what, const object& s) {
        const auto* all = find_array(s, "flags");
        if (all == nullptr) {
            return true;
        }
        constexpr long double beyond = 18446744073709551616.0L; // 2^64
        if (number < 0 || number >= beyond) {
            return fail("a number that combines no flags");
        }
        const auto bits = static_cast<std::uint64_t>(number);
        std::uint64_t contained = 0;
        bool is_named = false;
        for (const auto& each : *all) {
            const auto flag = count_in(each);
            contained |= (flag & ~bits) == 0 ? flag : 0;
            is_named = is_named || flag == bits;
        }
        // A key has one text only, so it is the name if there is one.
        return (contained == bits && !(is_named && what == kind::string)) || fail("a number that combines no flags");
    }

    bool fits_time(std::string_view json, bool is_duration, const object& unit) {
        json_reader r{json, any_depth};
        const auto bits = find_integer(unit, "bits");
        const auto num = find_integer(unit, "num");
        const auto den = find_integer(unit, "den");
        detail::whole_time whole;
        if (bits != 0 && is_duration) {
            double seconds = 0;
            return detail::read_duration(r, seconds)
                       ? is_held(seconds, num, den, bits) || fail(detail::time_out_of_range)
                       : fail(without_position(r.error()));
        }
        if (!(is_duration ? detail::read_duration(r, whole) : detail::read_time_point(r, whole))) {
            return fail(without_position(r.error()));
        }
        if (bits != 0) {
            return is_held(detail::seconds_of(whole), num, den, bits) || fail(detail::time_out_of_range);
        }
        std::int64_t units = 0;
        return (detail::count_units(whole, num, den, units) && units >= find_integer(unit, "minimum") &&
                units <= find_integer(unit, "maximum")) ||
               fail(detail::time_out_of_range);
    }
    // As std::chrono converts the number.
    static bool is_held(double seconds, std::int64_t num, std::int64_t den, std::int64_t bits) {
        auto units = seconds;
        if (den != 1) {
            units *= static_cast<double>(den);
        }
        if (num != 1) {
            units /= static_cast<double>(num);
        }
        const bool is_finite = bits == 32 ? std::isfinite(static_cast<float>(units)) : std::isfinite(units);
        return is_finite || !std::isfinite(seconds);
    }

    bool fits_object(std::string_view json, const object& s) {
        const auto* properties = find_object(s, "properties");
        const auto* others = find(s, "additionalProperties");
        const auto* names = find(s, "propertyNames");
        const auto* required = find_array(s, "required");
        const auto most = find_count(s, "maxProperties");
        if (properties == nullptr && others == nullptr && names == nullptr && required == nullptr && !most) {
            return true;
        }
        std::vector<std::string> seen;
        json_reader r{json, any_depth};
        std::string_view key;
        r.begin_object();
        while (r.next_key(key)) {
            const std::string name{key};
            std::string_view held;
            if (!r.read_raw(held)) {
                break;
            }
            const auto* wanted = properties != nullptr ? find(*properties, name) : nullptr;
            if (names != nullptr && !fits_inside(to_json(name), *names, name)) {
                return false;
            }
            wanted = wanted != nullptr ? wanted : others;
            if (wanted != nullptr && !fits_inside(held, *wanted, name)) {
                return false;
            }
            seen.push_back(name);
        }
        if (!r.ok()) {
            return fail(without_position(r.error()));
        }
        if (most && seen.size() > *most) {
            return fail("more than " + std::to_string(*most) + " members");
        }
        for (std::size_t i = 0; required != nullptr && i < required->size(); ++i) {
            const std::string name{text_in((*required)[i])};
            if (std::ranges::find(seen, name) == seen.end()) {
                path_.append(path_.empty() ? "" : ".").append(name);
                return fail("is missing");
            }
        }
        return true;
    }

    bool fits_array(std::string_view json, const object& s) {
        const auto* first = find_array(s, "prefixItems");
        const auto* others = find(s, "items");
        const auto least = find_count(s, "minItems");
        const auto most = find_count(s, "maxItems");
        std::size_t count = 0;
        json_reader r{json, any_depth};
        r.begin_array();
        while (r.next_element()) {
            std::string_view held;
            if (!r.read_raw(held)) {
                break;
            }
            const auto* wanted = first != nullptr && count < first->size() ? &(*first)[count] : others;
            if (wanted != nullptr && !fits_inside(held, *wanted, "[" + std::to_string(count) + "]")) {
                return false;
            }
            ++count;
        }
        if (!r.ok()) {
            return fail(without_position(r.error()));
        }
        if (most && count > *most) {
            return fail("more than " + std::to_string(*most) + " elements");
        }
        return !least || count >= *least || fail("fewer than " + std::to_string(*least) + " elements");
    }

    bool fits_all(std::string_view json, const object& s, int references) {
        const auto* all = find_array(s, "allOf");
        return all == nullptr || std::all_of(all->begin(), all->end(),
                                             [&](const value& each) { return fits(json, each, references + 1); });
    }

    bool fits_any(std::string_view json, const object& s, int references) {
        const auto* any = find_array(s, "anyOf");
        if (any == nullptr) {
            return true;
        }
        const auto before = path_;
        std::vector<std::string> reasons;
        for (const auto& each : *any) {
            if (fits(json, each, references + 1)) {
                return true;
            }
            path_ = before;
            const bool is_nothing = each.is_object() && find_text(each.get_object(), "type") == "null";
            if (!is_nothing) { // what may be missing: the other reason says more
                reasons.push_back(std::exchange(why_, {}));
            }
        }
        if (reasons.size() == 1) {
            why_ = std::move(reasons.front());
            return false;
        }
        constexpr std::size_t enough = 400; // for a person
        std::string why = "matches no alternative";
        const auto* separator = ": ";
        for (const auto& each : reasons) {
            if (why.size() > enough) {
                why.append("; ...");
                break;
            }
            why.append(std::exchange(separator, "; ")).append(each);
        }
        return fail(why);
    }

    const value& root_;
    std::string path_;
    std::string why_;
    std::size_t steps_ = 0;
};

// -- for people ----------------------------------------------------------------------------------------------------

constexpr int deepest_example = 12;

class example_maker {
  public:
    explicit example_maker(const value& root) noexcept : root_(root) {}

    std::string make(const value& of, int depth) {
        const auto* s = of.if_object();
        if (s == nullptr || depth == deepest_example || made_ > longest_types) {
            return "null";
        }
        for (const auto* name : {"default", "const"}) {
            if (const auto* one = find(*s, name)) {
                return keep(to_json(*one));
            }
        }
        for (const auto* name : {"examples", "enum"}) {
            if (const auto* some = find_array(*s, name); some != nullptr && !some->empty()) {
                return keep(to_json(some->front()));
            }
        }
        if (const auto reference = find_text(*s, "$ref"); !reference.empty()) {
            return make(*resolve(root_, reference), depth + 1);
        }
        if (const auto* any = find_array(*s, "anyOf")) {
            return make(any->front(), depth + 1);
        }
        if (const auto* all = find_array(*s, "allOf")) {
            return make(all->back(), depth + 1);
        }
        return make_typed(*s, depth);
    }

  private:
    std::string keep(std::string text) {
        made_ += text.size();
        return text;
    }

    std::string make_typed(const object& s, int depth) {
        const auto* types = find(s, "type");
        const auto type = types == nullptr    ? std::string_view{"object"}
                          : types->is_array() ? text_in(types->get_array().front())
                                              : text_in(*types);
        if (type == "object") {
            return make_object(s, depth);
        }
        if (type == "array") {
            return make_array(s, depth);
        }
        if (type == "string") {
            const auto format = find_text(s, "format");
            return keep(format == "duration"    ? R"("PT1S")"
                        : format == "date-time" ? R"("2026-01-01T00:00:00Z")"
                                                : R"("text")");
        }
        if (type == "number" || type == "integer") {
            const auto* least = find(s, "minimum");
            const auto* most = find(s, "maximum");
            return keep(least != nullptr && number_in(*least) > 0 ? to_json(*least)
                        : most != nullptr && number_in(*most) < 0 ? to_json(*most)
                                                                  : std::string{"0"});
        }
        return keep(type == "boolean" ? "false" : "null");
    }

    // Without the members that may be missing, unless it is known what they are then.
    std::string make_object(const object& s, int depth) {
        std::string out = "{";
        const auto* properties = find_object(s, "properties");
        const auto* required = find_array(s, "required");
        if (properties == nullptr) {
            return keep("{}");
        }
        for (const auto& member : *properties) {
            const auto name = view(member.key());
            const bool is_needed =
                required != nullptr && std::any_of(required->begin(), required->end(),
                                                   [&](const value& each) { return text_in(each) == name; });
            const auto* of = member.value().if_object();
            if (is_needed || (of != nullptr && find(*of, "default") != nullptr)) {
                out.append(out.size() == 1 ? "" : ",").append(to_json(name)).append(":");
                out.append(make(member.value(), depth + 1));
            }
        }
        return keep(out + "}");
    }

    std::string make_array(const object& s, int depth) {
        constexpr int deepest_optional = 4; // a list of what contains lists of the same
        std::string out = "[";
        std::size_t count = 0;
        const auto add = [&](const value& each) { out.append(count++ == 0 ? "" : ",").append(make(each, depth + 1)); };
        if (const auto* first = find_array(s, "prefixItems")) {
            for (const auto& each : *first) {
                add(each);
            }
        }
        const auto most = find_count(s, "maxItems").value_or(depth < deepest_optional ? 1 : 0);
        const auto wanted = std::max(find_count(s, "minItems").value_or(0), std::min<std::uint64_t>(most, 1));
        const auto* others = find(s, "items");
        while (others != nullptr && count < wanted && made_ <= longest_types) {
            add(*others);
        }
        return keep(out + "]");
    }

    const value& root_;
    std::size_t made_ = 0;
};

class explainer {
  public:
    explicit explainer(const value& root) noexcept : root_(root) {}

    std::string summary(const value& of, int depth = 0) const {
        constexpr int deepest = 8;
        const auto* s = of.if_object();
        if (s == nullptr || depth == deepest) {
            return "anything";
        }
        if (const auto reference = find_text(*s, "$ref"); !reference.empty()) {
            constexpr auto before = std::string_view{"#/$defs/"}.size();
            return reference.size() > before ? std::string{reference.substr(before)} : "the same";
        }
        if (const auto* choices = find_array(*s, "enum")) {
            return "one of " + list(*choices, ", ", [](const value& each) {
                       return each.is_string() ? std::string{text_in(each)} : to_json(each);
                   });
        }
        if (const auto* any = find_array(*s, "anyOf")) {
            return list(*any, " or ", [&](const value& each) { return summary(each, depth + 1); });
        }
        if (find(*s, "flags") != nullptr) {
            return "flags";
        }
        return typed(*s, depth);
    }

    void add_members(std::vector<schema_member>& out, const value& of, const std::string& prefix, int depth) const {
        constexpr int deepest = 4;
        constexpr std::size_t most = 256;
        const auto* s = object_in(of);
        const auto* properties = s != nullptr ? find_object(*s, "properties") : nullptr;
        if (properties == nullptr || depth == deepest) {
            return;
        }
        const auto* required = find_array(*s, "required");
        for (const auto& member : *properties) {
            if (out.size() == most) {
                return;
            }
            const auto name = view(member.key());
            const auto path = prefix + std::string{name};
            schema_member made{.path = path, .type = summary(member.value())};
            if (const auto* about = member.value().if_object()) {
                made.unit = find_text(*about, "unit");
                made.meaning = find_text(*about, "description");
                made.range = range_of(*about);
                const auto* standard = find(*about, "default");
                made.standard = standard != nullptr ? to_json(*standard) : std::string{};
            }
            made.required =
                required != nullptr && std::any_of(required->begin(), required->end(),
                                                   [&](const value& each) { return text_in(each) == name; });
            out.push_back(std::move(made));
            const auto* elements = elements_of(member.value());
            add_members(out, elements != nullptr ? *elements : member.value(),
                        path + (elements != nullptr ? "[]." : "."), depth + 1);
        }
    }

  private:
    template <class Name>
    static std::string list(const array& of, std::string_view between, Name name) {
        std::string out;
        for (const auto& each : of) {
            out.append(out.empty() ? std::string_view{} : between).append(name(each));
        }
        return out;
    }

    static std::string range_of(const object& s) {
        constexpr long double largest_exact = 9007199254740992.0L; // beyond, it is the range of a type
        const auto* least = find(s, "minimum");
        const auto* most = find(s, "maximum");
        if (least == nullptr || most == nullptr || number_in(*most) > largest_exact) {
            return {};
        }
        return to_json(*least) + " to " + to_json(*most);
    }

    // The object that a schema describes, behind references and `or null`.
    [[nodiscard]] const object* object_in(const value& of) const {
        const auto* now = &of;
        for (int i = 0; i < 8; ++i) {
            const auto* s = now->if_object();
            if (s == nullptr) {
                return nullptr;
            }
            const auto reference = find_text(*s, "$ref");
            const auto* any = find_array(*s, "anyOf");
            if (!reference.empty()) {
                now = resolve(root_, reference);
            } else if (any != nullptr) {
                now = &any->front();
            } else {
                return s;
            }
        }
        return nullptr;
    }
    [[nodiscard]] const value* elements_of(const value& of) const {
        const auto* s = object_in(of);
        return s != nullptr ? find(*s, "items") : nullptr;
    }

    std::string typed(const object& s, int depth) const {
        const auto format = find_text(s, "format");
        const auto* types = find(s, "type");
        const auto type = types == nullptr    ? std::string_view{}
                          : types->is_array() ? text_in(types->get_array().front())
                                              : text_in(*types);
        if (format == "duration" || format == "date-time") {
            return format == "duration" ? "duration" : "time";
        }
        if (type == "array") {
            if (const auto* first = find_array(s, "prefixItems")) {
                return "[" + list(*first, ", ", [&](const value& each) { return summary(each, depth + 1); }) + "]";
            }
            const auto* elements = find(s, "items");
            return elements != nullptr ? "array of " + summary(*elements, depth + 1) : "array";
        }
        if (type == "object") {
            const auto* others = find(s, "additionalProperties");
            return others != nullptr && others->is_object() ? "map of " + summary(*others, depth + 1) : "object";
        }
        return type.empty() ? "anything" : type == "string" ? "text" : std::string{type};
    }

    const value& root_;
};

} // namespace

schema::schema(std::string_view text) {
    if (text.size() > longest_types) {
        throw error(errc::conversion, "a schema has at most 65536 bytes");
    }
    auto made = std::make_shared<content>();
    made->root = from_json<value>(text);
    schema_check{made->root}.check(made->root, {});
    content_ = std::move(made);
}

std::string schema::mismatch(std::string_view json) const {
    json_reader reader{json};
    std::string_view whole;
    if (!reader.read_raw(whole) || !reader.at_end()) {
        return reader.error();
    }
    matcher match{content_->root};
    return match.fits(whole, content_->root) ? std::string{} : match.take_reason();
}

std::string schema::example() const {
    auto made = example_maker{content_->root}.make(content_->root, 0);
    return mismatch(made).empty() ? made : std::string{};
}

std::vector<schema_member> schema::members() const {
    std::vector<schema_member> out;
    explainer{content_->root}.add_members(out, content_->root, {}, 0);
    return out;
}

std::string schema::summary() const { return explainer{content_->root}.summary(content_->root); }

// -- of a task -----------------------------------------------------------------------------------------------------

namespace {

struct part {
    std::string_view name;
    std::string task_schemas::*text;
};
constexpr std::array<part, 4> parts{{{"parameters", &task_schemas::parameters},
                                     {"body", &task_schemas::body},
                                     {"result", &task_schemas::result},
                                     {"updates", &task_schemas::updates}}};

} // namespace

std::string task_types(const task_schemas& told) {
    std::string out;
    json_writer writer{out};
    writer.begin_object();
    for (const auto& each : parts) {
        const auto& text = told.*each.text;
        if (text.empty()) {
            continue;
        }
        try {
            static_cast<void>(schema{text});
        } catch (const error& e) {
            throw error(errc::invalid_option, std::string{each.name} + ": " + e.message());
        }
        std::string compact;
        append_compact_json(text, compact);
        writer.plain_key(each.name);
        writer.raw(compact);
    }
    writer.end_object();
    if (out.size() > longest_types || !is_valid_json(out, deepest_types)) {
        throw error(errc::invalid_option, "the types are longer than 64 KiB, or nested too deep");
    }
    return out == "{}" ? std::string{} : out;
}

task_schemas read_task_types(std::string_view text) {
    task_schemas out;
    json_reader reader{text};
    std::string_view key;
    bool good = text.size() <= longest_types && reader.begin_object();
    while (good && reader.next_key(key)) {
        const auto* const known = std::ranges::find(parts, key, &part::name);
        std::string_view raw;
        good = reader.read_raw(raw);
        if (good && known != parts.end()) { // a newer node may tell more
            out.*known->text = raw;
        }
    }
    if (!good || !reader.at_end()) {
        throw error(errc::conversion, "the types of a task are not valid: " + reader.error());
    }
    return out;
}

} // namespace cles
