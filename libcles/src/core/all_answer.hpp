// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "protocol/reply_line.hpp"

#include <optional>
#include <string>
#include <string_view>

namespace cles::core {

/// The answer to a request for `all`: what each node said, in the order of their names.
class all_answer {
  public:
    void add_result(std::string_view node, std::string_view json);
    void add_failure(std::string_view node, const protocol::failure& why);
    /// Which update a node's result is. With the first, the answer says so of all of which it is known.
    void add_mark(std::string_view node, const std::optional<update_mark>& mark);
    [[nodiscard]] std::string whole() const;

  private:
    static void begin_member(std::string& in, std::string_view node);

    std::string results_ = R"({"results":{)";
    std::string errors_;
    std::optional<std::string> marks_{};
};

/// When it is to leave, so that it comes before the time runs out.
time_point answer_by(time_point due, time_point now);
/// What is said for a node that has not answered by then.
protocol::failure late(std::string_view node);

} // namespace cles::core
