// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/standard.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace cles {

/// Reads JSON (RFC 8259, strictly) from text that it borrows, value by value, without building a tree.
///
/// Every call returns whether it succeeded; after the first failure all further ones fail too, and `error` says what
/// was expected, where. Doubles are read exactly (`std::from_chars`). The text must outlive the reader; a key or string
/// view that a call hands out is valid until the next call. Not thread-safe.
class json_reader {
  public:
    enum class kind : std::uint8_t { object, array, string, number, boolean, null, invalid };

    /// The depth counts brackets, the outermost being 1.
    explicit json_reader(std::string_view text, std::size_t max_depth = 32) noexcept
        : text_(text), max_depth_(max_depth) {}

    /// What kind of value comes next, without consuming it.
    [[nodiscard]] kind peek() noexcept;

    bool begin_object();
    /// Moves to the object's next member; false at its end, which it consumes, and on failure (see `ok`).
    bool next_key(std::string_view& key);
    /// As `next_key`, but only where the next member is `name`, written plainly and without white space: then true.
    /// Otherwise nothing is consumed. Quicker where the order of members is known.
    bool next_key_is(std::string_view name) noexcept;
    bool begin_array();
    /// Moves to the array's next element; false at its end, which it consumes, and on failure (see `ok`).
    bool next_element();

    bool read_null();
    bool read(bool& out);
    bool read(double& out);
    bool read(std::int64_t& out);
    bool read(std::uint64_t& out);
    bool read(std::string& out);
    /// A string without copying where it holds no escapes.
    bool read(std::string_view& out);
    /// Skips one value of any kind, checking all of it.
    bool skip();
    /// Skips one value and hands out its text as it stands.
    bool read_raw(std::string_view& out);
    /// True when nothing but white space is left.
    bool at_end();

    [[nodiscard]] bool ok() const noexcept { return message_.empty(); }
    /// Fails with this message at the current place.
    bool fail(std::string_view message);
    /// Fails as another reader did, which was given a part of this one's text.
    bool fail_as(const json_reader& part);
    /// Called while unwinding from a failure: names the member or element that it happened in.
    void inside_member(std::string_view name);
    void inside_element(std::size_t index);
    /// As in "localization.lat: expected a number, got a string (at byte 12)".
    [[nodiscard]] std::string error() const;

  private:
    void skip_space() noexcept {
        while (at_ < text_.size() && text_[at_] <= ' ' && is_space(text_[at_])) {
            ++at_;
        }
    }
    static constexpr bool is_space(char c) noexcept { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }
    bool expected(std::string_view what);
    bool enter();
    bool fail_too_deep();
    bool literal(std::string_view word);
    bool scan_number(std::string_view& out, bool& integral);
    bool scan_string(std::string_view& raw, bool& escaped);

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

/// Checks that `text` is one JSON value, whole and valid. On failure `why` (if given) says what and where.
bool is_valid_json(std::string_view text, std::size_t max_depth = 32, std::string* why = nullptr);

/// Appends the JSON value in `text` to `out` without its white space outside strings. The text must be valid.
void append_compact_json(std::string_view text, std::string& out);

} // namespace cles
