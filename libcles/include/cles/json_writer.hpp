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
/// Floating-point numbers are written with the fewest digits that round-trip (`45.1`), those of a `float` as a `float`;
/// one that is not finite becomes `null`, because JSON cannot express it. In text that is not UTF-8, invalid bytes
/// become U+FFFD, so the output is always valid. Not thread-safe; the string must outlive the writer.
///
/// What readers refuse is not written: beyond the depth that they accept, `begin_object` and `begin_array` throw, which
/// also ends the recursion of a value that contains itself.
class json_writer {
  public:
    /// What readers of results and updates accept: the depth of a body, and what may be wrapped around it.
    static constexpr std::size_t most_levels = 32 + 3;

    /// \param max_depth of nested brackets; the outermost has depth 1
    explicit json_writer(std::string& out, std::size_t max_depth = most_levels) noexcept
        : out_(out), start_(out.size()), max_depth_(max_depth) {}

    /// \throws cles::error with `conversion` if brackets are nested too deep
    void begin_object() { open('{'); }
    void end_object() { close('}'); }
    /// \throws as `begin_object`
    void begin_array() { open('['); }
    void end_array() { close(']'); }
    void key(std::string_view name);
    /// Writes a key that needs no escapes, such as the name of a C++ member.
    void plain_key(std::string_view name);
    /// As `plain_key`, with text prepared at compile time. \pre an object is open
    void plain_key(const prepared_key& name);

    void null();
    void value(bool b);
    void value(double d);
    void value(float f);
    void value(std::int64_t i);
    void value(std::uint64_t u);
    void value(std::string_view text);
    /// Writes JSON text that must be valid and free of white space. It is checked before it is sent.
    void raw(std::string_view json);
    /// As `raw`, for text that has been checked, which is not checked again.
    void checked(std::string_view json);
    /// Puts text around all that was written. The whole is checked before it is sent.
    void enclose(std::string_view before, std::string_view after);

    /// The position in `written` where text that is not UTF-8 was first replaced; `npos` if there was none.
    [[nodiscard]] std::size_t broken_text() const noexcept { return broken_; }
    static constexpr std::size_t npos = std::string_view::npos;

    /// Whether what was written is certainly JSON that readers accept: all brackets are closed, no text was replaced,
    /// and nothing came through `raw`.
    [[nodiscard]] bool is_certain() const noexcept { return depth_ == 0 && broken_ == npos && !has_raw_; }
    /// How many levels of brackets may still be opened inside those that are open.
    [[nodiscard]] std::size_t levels_left() const noexcept { return max_depth_ - depth_; }
    [[nodiscard]] std::size_t max_depth() const noexcept { return max_depth_; }

    /// What this writer has written.
    [[nodiscard]] std::string_view written() const noexcept { return std::string_view{out_}.substr(start_); }

  private:
    void open(char bracket);
    void close(char bracket) {
        depth_ -= depth_ != 0 ? 1U : 0U;
        out_.push_back(bracket);
    }
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
    std::size_t max_depth_;
    std::size_t depth_ = 0;
    std::size_t broken_ = npos;
    bool has_raw_ = false;
};

} // namespace cles
