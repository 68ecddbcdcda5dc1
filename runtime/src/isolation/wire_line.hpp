// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>
#include <cles/verb.hpp>

#include <boost/describe/class.hpp>

#include <charconv>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

/// The lines that the daemon and the process of an isolated plugin exchange. They are lines of the language
/// (docs/protocol.md), with adverbs of their own; runtime/README.md lists them.

namespace cles::runtime {

/// A decimal number; nothing if the text is anything else.
template <class Integer>
std::optional<Integer> to_number(std::string_view text) noexcept {
    Integer number{};
    const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), number);
    return failed == std::errc{} && end == text.data() + text.size() ? std::optional{number} : std::nullopt;
}

/// Writes one line. Parameters and the values of adverbs are percent-encoded.
class wire_line_writer {
  public:
    /// A request to `self:task`.
    wire_line_writer(cles::verb verb, std::string_view task);
    /// A reply to the request with that id.
    explicit wire_line_writer(std::uint64_t id);

    // In this order:
    wire_line_writer& parameter(std::string_view text);
    wire_line_writer& parameter(std::uint64_t number);
    wire_line_writer& adverb(std::string_view key, std::string_view value);
    wire_line_writer& adverb(std::string_view key, std::int64_t value);
    /// Ends the line, and returns it. \param json an object or an array
    [[nodiscard]] std::string body(std::string_view json);
    template <class T>
        requires(!std::convertible_to<T, std::string_view>)
    [[nodiscard]] std::string body(const T& value) { return body(std::string_view{to_json(value)}); }

  private:
    std::string line_;
};

/// A line that was read. Its text is a view of the line.
struct wire_line {
    bool is_reply = false;
    cles::verb verb = verb::pull;
    std::string_view task{};
    std::vector<std::string> parameters{}; ///< decoded
    std::uint64_t id = 0;                  ///< 0: none
    std::vector<std::pair<std::string_view, std::string>> adverbs{};
    std::string_view body = "{}"; ///< not checked

    /// Empty if there is none.
    [[nodiscard]] std::string_view adverb(std::string_view key) const noexcept;
    [[nodiscard]] std::optional<std::int64_t> number(std::string_view key) const noexcept;
    /// The parameter as a number; 0 if it is missing or is none.
    [[nodiscard]] std::uint64_t number_at(std::size_t index) const noexcept;
};

/// Reads a line without its LF. Nothing if it is malformed.
std::optional<wire_line> read_wire_line(std::string_view line);

/// The body of a reply: JSON as it is if it is an object or an array, nothing as {}, and anything else as {"value":x}.
std::string reply_body(std::string_view json);
/// The body of a reply that is a failure.
struct wire_failure {
    std::string error; ///< its code
    std::string message;
    std::optional<std::int64_t> retry_ms{};
};
BOOST_DESCRIBE_STRUCT(wire_failure, (), (error, message, retry_ms))
CLES_DEFAULTS(wire_failure, (message))
std::string failure_body(const wire_failure& what);
/// Nothing if the body of a reply is a success.
std::optional<wire_failure> read_failure(std::string_view body);

} // namespace cles::runtime
