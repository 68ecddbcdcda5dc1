// SPDX-License-Identifier: BSL-1.0
#include "core/all_answer.hpp"

#include "protocol/request_line.hpp"

#include <algorithm>
#include <chrono>

namespace cles::core {

void all_answer::begin_member(std::string& in, std::string_view node) {
    in.append(in.empty() || in.ends_with('{') ? "\"" : ",\"").append(node).append("\":"); // a name needs no escapes
}

void all_answer::add_result(std::string_view node, std::string_view json) {
    begin_member(results_, node);
    results_.append(json);
}

void all_answer::add_failure(std::string_view node, const protocol::failure& why) {
    begin_member(errors_, node);
    append_failure(errors_, why);
}

void all_answer::add_mark(std::string_view node, const std::optional<update_mark>& mark) {
    auto& marks = marks_ ? *marks_ : marks_.emplace();
    if (mark) {
        begin_member(marks, node);
        marks.append(R"({"seq":)").append(std::to_string(mark->seq));
        marks.append(R"(,"epoch":")").append(protocol::epoch_text(mark->epoch)).append("\"}");
    }
}

std::string all_answer::whole() const {
    auto text = results_ + R"(},"errors":{)" + errors_ + "}";
    if (marks_) {
        text.append(R"(,"marks":{)").append(*marks_).append("}");
    }
    return text + "}";
}

time_point answer_by(time_point due, time_point now) {
    constexpr std::chrono::milliseconds most{50};
    return due - std::min<time_point::duration>((due - now) / 8, most);
}

protocol::failure late(std::string_view node) {
    return {.code = errc::deadline, .message = std::string{node} + " did not answer in time"};
}

} // namespace cles::core
