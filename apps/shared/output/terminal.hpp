// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/printable.hpp>

#include <chrono>
#include <cstddef>
#include <exception>
#include <string>
#include <string_view>

namespace tool {

enum class stream { out = 1, err = 2 };

/// The reader of the output has closed it, as `head` does: a reason to end, but not an error.
class output_closed : public std::exception {
  public:
    [[nodiscard]] const char* what() const noexcept override { return "the output is closed"; }
};

/// A write was interrupted by a signal.
class output_interrupted : public std::exception {
  public:
    [[nodiscard]] const char* what() const noexcept override { return "interrupted"; }
};

bool is_terminal(stream s);

/// Whether to colour: only on a terminal with colours, and never where NO_COLOR is set (no-color.org).
bool has_colours(stream s);

/// The text in bold, where the stream supports it.
std::string bold(stream s, std::string_view text);
/// The text in red, where the stream supports it.
std::string red(stream s, std::string_view text);

/// For text from elsewhere, before it is put into lines and tables.
using cles::printable;

/// The columns that printable text takes, counting characters.
std::size_t width_of(std::string_view text);

/// The text, filled with spaces up to that width, at its left or right.
std::string padded(std::string text, std::size_t width, bool align_right = false);

// What is written contains no control characters but those of C0. Others, and those that change the direction of
// writing, become escapes; in JSON they mean the same.

/// Writes all of the text to stdout, at once, so that the reader of a pipe sees each document as soon as it is there.
/// \throws output_closed, output_interrupted, or a system error
void write_output(std::string_view text);

/// Writes the text to stderr in one call, so that lines of several processes do not mix.
void write_stderr(std::string_view text);

/// Writes what the stream takes within that time, and drops the rest: for a program that must not wait for a reader.
/// May be used in a signal handler.
void write_within(stream s, std::string_view text, std::chrono::milliseconds limit) noexcept;

/// Whether the reader of stdout is gone, where that can be determined without writing.
bool is_output_closed();

} // namespace tool
