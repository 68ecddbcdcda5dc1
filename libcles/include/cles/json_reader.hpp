// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/prepared_key.hpp>
#include <cles/standard.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace cles {

/// Reads JSON (RFC 8259, strictly) value by value from borrowed text, without building a tree.
///
/// Functions return whether they succeeded. After the first failure, all others fail too, and `error` says what was
/// expected and where. Numbers are read exactly (`std::from_chars`). The text must outlive the reader; a key or string
/// view that a function returns is valid until the next call. Not thread-safe.
class json_reader {
  public:
    enum class kind : std::uint8_t { object, array, string, number, boolean, null, invalid };

    /// \param max_depth of nested brackets; the outermost has depth 1
    explicit json_reader(std::string_view text, std::size_t max_depth = 32) noexcept
        : text_(text), max_depth_(max_depth) {}

    /// The kind of the next value, without consuming it.
    [[nodiscard]] kind peek() noexcept;

    bool begin_object();
    /// Moves to the object's next member. False at the end of the object, which it consumes, and on failure (see `ok`).
    bool next_key(std::string_view& key);
    /// True if the next member is `name`, written without escapes and white space; then works as `next_key`. Otherwise
    /// consumes nothing. Faster than `next_key` if the order of members is known.
    bool next_key_is(std::string_view name) noexcept;
    /// The same for a key that was prepared at compile time: one comparison.
    bool next_key_is(const prepared_key& name) noexcept;
    bool begin_array();
    /// Moves to the array's next element. False at the end of the array, which it consumes, and on failure (see `ok`).
    bool next_element();

    bool read_null();
    bool read(bool& out);
    bool read(double& out);
    bool read(float& out);
    /// The same, but null is NaN: numbers that are not finite are written so.
    bool read_or_nan(double& out);
    bool read_or_nan(float& out);
    bool read(std::int64_t& out);
    bool read(std::uint64_t& out);
    bool read(std::string& out);
    /// Reads a string; copies it only if it contains escapes.
    bool read(std::string_view& out);
    /// Skips one value of any kind and validates it.
    bool skip();
    /// Skips one value, validates it and returns its text unchanged.
    bool read_raw(std::string_view& out);
    /// True if only white space is left; fails otherwise.
    bool at_end();

    [[nodiscard]] bool ok() const noexcept { return message_.empty(); }
    /// Fails with this message at the current position.
    bool fail(std::string_view message);
    /// Fails with the error of another reader, which read a part of this reader's text.
    bool fail_as(const json_reader& part);
    /// Called while unwinding from a failure: adds the member or element in which it happened to the path.
    void inside_member(std::string_view name);
    void inside_element(std::size_t index);
    /// The failure, as in "localization.lat: expected a number, got a string (at byte 12)".
    [[nodiscard, gnu::cold]] std::string error() const;

  private:
    void skip_space() noexcept {
        while (at_ < text_.size() && text_[at_] <= ' ' && is_space(text_[at_])) {
            ++at_;
        }
    }
    static constexpr bool is_space(char c) noexcept { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }
    /// The next character that is not white space; 0 at the end.
    char look() noexcept {
        skip_space();
        return at_ < text_.size() ? text_[at_] : '\0';
    }
    [[gnu::cold]] bool expected(std::string_view what);
    [[gnu::cold]] bool expected_word(std::string_view word);
    bool require(kind wanted);
    bool enter();
    [[gnu::cold]] bool fail_too_deep();
    bool next(char close);
    bool literal(std::string_view word);
    bool scan_number(std::string_view& out, bool& integral);
    bool scan_string(std::string_view& out, std::string& decoded);
    bool scan_key(std::string_view& out, std::string& decoded);
    template <class Integer>
    bool read_integer(Integer& out, std::string_view out_of_range);
    bool skip_value(std::size_t depth);
    bool skip_values(char close, std::size_t depth);

    std::string_view text_;
    std::size_t at_ = 0;
    std::size_t max_depth_;
    std::size_t depth_ = 0;
    bool first_ = false;
    std::string scratch_;
    std::string message_;
    std::string path_;
    std::size_t failed_at_ = 0;
};

/// Whether `text` is exactly one valid JSON value. If not, `why` (if given) says what is wrong and where.
bool is_valid_json(std::string_view text, std::size_t max_depth = 32, std::string* why = nullptr);

/// Appends the JSON value in `text` to `out` without white space outside strings. The text must be valid.
void append_compact_json(std::string_view text, std::string& out);

} // namespace cles
