// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/error.hpp>

#include <cstdint>
#include <exception>
#include <optional>
#include <string>
#include <string_view>

namespace tool {

/// Pairs lines that contain bodies with what is printed for them: for each line one, in the same order, whether its
/// request succeeds or not.
class line_answers {
  public:
    /// The body in a line, to be sent. If it is none, nothing is sent, and `failure` is its answer.
    std::optional<std::string> take(std::uint64_t number, std::string_view line);
    /// The body of the line that was taken last is not sent.
    void refuse(const std::string& why);
    /// Its request has failed.
    void fail(cles::errc code, const std::string& message);
    /// Its answer then, as a node would write it: {"error":"busy","message":"full"}
    [[nodiscard]] const std::string& failure() const noexcept { return failure_; }

    /// Why the first line failed that did: with the number of the line, to be thrown at the end; null if none did.
    [[nodiscard]] const std::exception_ptr& first_failure() const noexcept { return first_; }

  private:
    void write_failure(cles::errc code, const std::string& message);
    /// What is said of the failure at the end.
    [[nodiscard]] std::string with_number(const std::string& message) const;

    std::uint64_t number_ = 0;
    std::string failure_;
    std::exception_ptr first_;
};

} // namespace tool
