// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <CLI/App.hpp>
#include <CLI/Formatter.hpp>

#include <cstddef>
#include <string>

namespace tool {

/// Help texts that wrap at the width of the terminal. Elsewhere, their lines are as long as they were written.
class help_formatter : public CLI::Formatter {
  public:
    std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override;
};

/// The text with lines of that width at most: paragraphs are filled anew, descriptions of options go on below their
/// beginning. Examples, which are to be copied, and words that are longer remain as they are.
/// \param column where descriptions of options begin
std::string wrapped_help(const std::string& text, std::size_t width, std::size_t column);

} // namespace tool
