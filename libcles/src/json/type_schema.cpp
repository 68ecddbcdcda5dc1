// SPDX-License-Identifier: BSL-1.0
#include <cles/type_schema.hpp>

#include <algorithm>

namespace cles::detail {

struct schema_writer::definition {
    const void* type;
    std::string name;
    std::string text;
};

namespace {

constexpr bool is_letter(char c) noexcept {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

// "position" of "... [with T = car::position; ...]" or "... [T = car::position]".
std::string_view type_name(std::string_view compiled) noexcept {
    constexpr std::string_view before = "T = ";
    const auto at = compiled.find(before);
    if (at == std::string_view::npos) {
        return "type";
    }
    compiled.remove_prefix(at + before.size());
    compiled = compiled.substr(0, compiled.find_first_of(";]"));
    auto begin = compiled.size();
    while (begin != 0 && is_letter(compiled[begin - 1])) {
        --begin;
    }
    compiled.remove_prefix(begin);
    return compiled.empty() ? std::string_view{"type"} : compiled; // an instance of a template has no simple name
}

// Each function writes the members of one of the schemas.
template <typename First, typename Second>
void write_any_of(json_writer& w, const First& first, const Second& second) {
    w.plain_key("anyOf");
    w.begin_array();
    w.begin_object();
    first();
    w.end_object();
    w.begin_object();
    second();
    w.end_object();
    w.end_array();
}

} // namespace

schema_writer::schema_writer() { root_.begin_object(); }
schema_writer::~schema_writer() = default;

void schema_writer::type(std::string_view name) {
    out_->plain_key("type");
    out_->value(name);
}

void schema_writer::limits(std::int64_t minimum, std::uint64_t maximum) {
    const auto range = std::exchange(range_, std::nullopt);
    out_->plain_key("minimum");
    if (range && range->minimum > static_cast<double>(minimum)) {
        out_->value(range->minimum);
    } else {
        out_->value(minimum);
    }
    out_->plain_key("maximum");
    if (range && range->maximum < static_cast<double>(maximum)) {
        out_->value(range->maximum);
    } else {
        out_->value(maximum);
    }
}

void schema_writer::integer(std::int64_t minimum, std::uint64_t maximum) {
    type("integer");
    limits(minimum, maximum);
}

void schema_writer::number(bool is_float) {
    out_->plain_key("type");
    out_->raw(R"(["number","null"])"); // null is a number that is not finite
    if (is_float) {
        out_->plain_key("format");
        out_->value(std::string_view{"float"});
    }
    if (const auto range = std::exchange(range_, std::nullopt)) {
        out_->plain_key("minimum");
        out_->value(range->minimum);
        out_->plain_key("maximum");
        out_->value(range->maximum);
    }
}

void schema_writer::text(bool or_null) {
    if (or_null) {
        out_->plain_key("type");
        out_->raw(R"(["string","null"])");
    } else {
        type("string");
    }
}

void schema_writer::count(std::string_view keyword, std::size_t n) {
    out_->plain_key(keyword);
    out_->value(std::uint64_t{n});
}

void schema_writer::names(const enum_values& known) {
    out_->plain_key("enum");
    out_->begin_array();
    for (const auto name : known.names) {
        out_->value(name);
    }
    out_->end_array();
}

void schema_writer::flags(const enum_values& known) {
    out_->plain_key("flags");
    out_->begin_array();
    for (const auto value : known.values) {
        if (!known.is_signed || static_cast<std::int64_t>(value) >= 0) { // negative numbers are not read
            out_->value(value);
        }
    }
    out_->end_array();
}

void schema_writer::enumeration(const enum_values& known) {
    if (!known.has_union) {
        names(known);
        return;
    }
    const auto write_number = [this, &known] {
        integer(0, known.is_signed ? static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())
                                   : std::numeric_limits<std::uint64_t>::max());
        flags(known);
    };
    write_any_of(
        *out_, [this, &known] { names(known); }, write_number);
}

void schema_writer::integer_keys(std::int64_t minimum, std::uint64_t maximum) {
    out_->begin_object();
    out_->plain_key("format");
    out_->value(std::string_view{"integer"});
    limits(minimum, maximum);
    out_->end_object();
}

void schema_writer::enum_keys(const enum_values& known) {
    out_->begin_object();
    if (known.has_union) {
        const auto write_number = [this, &known] {
            out_->plain_key("format");
            out_->value(std::string_view{"integer"});
            flags(known);
        };
        write_any_of(
            *out_, [this, &known] { names(known); }, write_number);
    } else {
        names(known);
    }
    out_->end_object();
}

void schema_writer::time(std::string_view format, const ticks& unit, bool or_null) {
    out_->plain_key("type");
    out_->raw(or_null ? R"(["string","number","null"])" : R"(["string","number"])");
    out_->plain_key("format");
    out_->value(format);
    out_->plain_key("ticks");
    out_->begin_object();
    out_->plain_key("num");
    out_->value(unit.num);
    out_->plain_key("den");
    out_->value(unit.den);
    if (unit.bits != 0) {
        out_->plain_key("bits");
        out_->value(unit.bits);
    } else {
        out_->plain_key("minimum");
        out_->value(unit.minimum);
        out_->plain_key("maximum");
        out_->value(unit.maximum);
    }
    out_->end_object();
}

void schema_writer::note(const field_note& what) {
    if (!what.meaning.empty()) {
        out_->plain_key("description");
        out_->value(what.meaning);
    }
    if (!what.unit.empty()) {
        out_->plain_key("unit");
        out_->value(what.unit);
    }
    if (what.has_range()) {
        range_ = what;
    }
}

void schema_writer::stated(std::string_view schema) {
    const auto begin = schema.find('{');
    const auto end = schema.rfind('}');
    if (begin == std::string_view::npos || end == std::string_view::npos || end <= begin + 1) {
        return;
    }
    out_->raw(schema.substr(begin + 1, end - begin - 1));
}

void schema_writer::refer(const void* type, std::string_view compiled, void (*define)(schema_writer&)) {
    const auto known = std::ranges::find(definitions_, type, [](const auto& each) { return each->type; });
    const auto at = static_cast<std::size_t>(known - definitions_.begin());
    if (known == definitions_.end()) {
        const std::string plain{type_name(compiled)};
        auto name = plain;
        const auto is_used = [&] {
            return std::ranges::any_of(definitions_, [&](const auto& each) { return each->name == name; });
        };
        for (std::size_t number = 2; is_used(); ++number) { // types of different namespaces
            name = plain + "_" + std::to_string(number);
        }
        definitions_.push_back(std::make_unique<definition>(definition{type, std::move(name), {}}));
        json_writer inner{definitions_.back()->text};
        auto* const outer = std::exchange(out_, &inner);
        inner.begin_object();
        define(*this);
        inner.end_object();
        out_ = outer;
    }
    out_->plain_key("$ref");
    out_->value(std::string_view{"#/$defs/" + definitions_[at]->name});
}

std::string schema_writer::finish() {
    if (!definitions_.empty()) {
        root_.plain_key("$defs");
        root_.begin_object();
        for (const auto& each : definitions_) {
            root_.plain_key(each->name);
            root_.raw(each->text);
        }
        root_.end_object();
    }
    root_.end_object();
    detail::require_readable(root_);
    return std::move(text_);
}

} // namespace cles::detail
