// SPDX-License-Identifier: BSL-1.0
#include "client/line_answers.hpp"

#include <cles/json_writer.hpp>

#include "options/arguments.hpp"
#include "output/errors.hpp"

namespace tool {

std::optional<std::string> line_answers::take(std::uint64_t number, std::string_view line) {
    number_ = number;
    failure_.clear();
    try {
        return checked_body(line, "the body");
    } catch (const usage_error& e) {
        refuse(e.what());
    }
    return std::nullopt;
}

void line_answers::refuse(const std::string& why) {
    write_failure(cles::errc::bad_request, why);
    if (!first_) {
        first_ = std::make_exception_ptr(usage_error(with_number(why)));
    }
}

void line_answers::fail(cles::errc code, const std::string& message) {
    write_failure(code, message);
    if (!first_) {
        first_ = std::make_exception_ptr(cles::error(code, with_number(message)));
    }
}

void line_answers::write_failure(cles::errc code, const std::string& message) {
    failure_.clear();
    cles::json_writer w{failure_};
    w.begin_object();
    w.key("error");
    w.value(wire_name(code));
    w.key("message");
    w.value(std::string_view{message});
    w.end_object();
}

std::string line_answers::with_number(const std::string& message) const {
    return "line " + std::to_string(number_) + " of stdin: " + message;
}

} // namespace tool
