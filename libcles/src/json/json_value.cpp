// SPDX-License-Identifier: BSL-1.0
#include <cles/json_value.hpp>

#include <boost/json/array.hpp>
#include <boost/json/object.hpp>

#include <charconv>

namespace cles {
namespace json = boost::json;

namespace {

std::string_view view(json::string_view s) { return {s.data(), s.size()}; }

bool read_number(json_reader& r, json::value& value) {
    std::string_view raw;
    if (!r.read_raw(raw)) {
        return false;
    }
    json_reader number{raw};
    // -0 is the written form of a double; no integer has its sign.
    if (raw.find_first_of(".eE") == std::string_view::npos && raw != "-0") {
        const auto fits = [&](auto integer) {
            const bool good = std::from_chars(raw.data(), raw.data() + raw.size(), integer).ec == std::errc{};
            if (good) {
                value = integer;
            }
            return good;
        };
        if (fits(std::int64_t{}) || fits(std::uint64_t{})) {
            return true;
        }
    }
    double d = 0;
    if (!number.read(d)) {
        return r.fail("a number out of the range of a double");
    }
    value = d;
    return true;
}

} // namespace

void converter<json::object>::write(json_writer& w, const json::object& value) {
    w.begin_object();
    for (const auto& member : value) {
        w.key(view(member.key()));
        write_json(w, member.value());
    }
    w.end_object();
}

bool converter<json::object>::read(json_reader& r, json::object& value) {
    value.clear();
    if (!r.begin_object()) {
        return false;
    }
    std::string_view key;
    while (r.next_key(key)) {
        const std::string name{key};
        if (!read_json(r, value[name])) {
            r.inside_member(name);
            return false;
        }
    }
    return r.ok();
}

void converter<json::array>::write(json_writer& w, const json::array& value) {
    w.begin_array();
    for (const auto& element : value) {
        write_json(w, element);
    }
    w.end_array();
}

bool converter<json::array>::read(json_reader& r, json::array& value) {
    value.clear();
    if (!r.begin_array()) {
        return false;
    }
    while (r.next_element()) {
        value.emplace_back(nullptr);
        if (!read_json(r, value.back())) {
            r.inside_element(value.size() - 1);
            return false;
        }
    }
    return r.ok();
}

void converter<json::value>::write(json_writer& w, const json::value& value) {
    switch (value.kind()) {
    case json::kind::null: w.null(); break;
    case json::kind::bool_: w.value(value.get_bool()); break;
    case json::kind::int64: w.value(value.get_int64()); break;
    case json::kind::uint64: w.value(value.get_uint64()); break;
    case json::kind::double_: w.value(value.get_double()); break;
    case json::kind::string: w.value(view(value.get_string())); break;
    case json::kind::array: write_json(w, value.get_array()); break;
    case json::kind::object: write_json(w, value.get_object()); break;
    }
}

bool converter<json::value>::read(json_reader& r, json::value& value) {
    switch (r.peek()) {
    case json_reader::kind::object: return read_json(r, value.emplace_object());
    case json_reader::kind::array: return read_json(r, value.emplace_array());
    case json_reader::kind::string: {
        std::string_view text;
        if (!r.read(text)) {
            return false;
        }
        value.emplace_string().assign(text.data(), text.size());
        return true;
    }
    case json_reader::kind::number: return read_number(r, value);
    case json_reader::kind::boolean: return r.read(value.emplace_bool());
    case json_reader::kind::null: value = nullptr; return r.read_null();
    case json_reader::kind::invalid: break;
    }
    return r.skip();
}

} // namespace cles
