// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/prepared_key.hpp>
#include <cles/standard.hpp>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace cles {

/// Appends JSON (RFC 8259) without white space to a borrowed string.
///
/// Commas and colons are added automatically: call `key` before each member of an object, and write one value after it.
/// Doubles are written with the fewest digits that round-trip (`45.1`); a double that is not finite becomes `null`,
/// because JSON cannot express it. In text that is not UTF-8, invalid bytes become U+FFFD, so the output is always
/// valid. Not thread-safe; the string must outlive the writer.
class json_writer {
  public:
    explicit json_writer(std::string& out) noexcept : out_(out), start_(out.size()) {}

    void begin_object() { open('{'); }
    void end_object() { out_.push_back('}'); }
    void begin_array() { open('['); }
    void end_array() { out_.push_back(']'); }
    void key(std::string_view name);
    /// Writes a key that needs no escapes, such as the name of a C++ member.
    void plain_key(std::string_view name);
    /// As `plain_key`, with text prepared at compile time. \pre an object is open
    void plain_key(const prepared_key& name);

    void null();
    void value(bool b);
    void value(double d);
    void value(std::int64_t i);
    void value(std::uint64_t u);
    void value(std::string_view text);
    /// Writes JSON text that must be valid and free of white space.
    void raw(std::string_view json);

    /// The position in `written` where text that is not UTF-8 was first replaced; `npos` if there was none.
    [[nodiscard]] std::size_t broken_text() const noexcept { return broken_; }
    static constexpr std::size_t npos = std::string_view::npos;

    /// What this writer has written.
    [[nodiscard]] std::string_view written() const noexcept { return std::string_view{out_}.substr(start_); }

  private:
    void open(char bracket);
    void append_string(std::string_view text);
    // In compact JSON, the last character shows whether a comma is needed. So no stack of open brackets is needed.
    void separate() {
        if (out_.size() > start_) {
            const auto last = out_.back();
            if (last != '{' && last != '[' && last != ':') {
                out_.push_back(',');
            }
        }
    }

    std::string& out_;
    std::size_t start_;
    std::size_t broken_ = npos;
};

} // namespace cles
