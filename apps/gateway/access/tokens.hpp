// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace gateway {

/// The tokens that are accepted, by their SHA-256. Who reads them learns no token: each has 256 random bits.
class token_table {
  public:
    /// Reads the lines of a file: `NAME HASH`, the name of a member and 64 hex digits in small letters; `#` begins a
    /// comment. \throws std::runtime_error that names the line
    static token_table read(std::string_view text);

    /// Whose the token with this hash is; empty if there is none.
    [[nodiscard]] std::string_view name_of(std::string_view hash) const;
    [[nodiscard]] std::size_t size() const noexcept { return names_.size(); }

  private:
    std::map<std::string, std::string, std::less<>> names_; // by hash
};

/// The file with the tokens. Only its user can read and change it: its mode is 0600.
class token_file {
  public:
    explicit token_file(std::string path) : path_(std::move(path)) {}

    /// The tokens, if the file is another one than at the last call. \throws std::runtime_error with a message for
    /// people if it cannot be used, once for each change: then no token counts
    std::optional<token_table> read_if_changed();
    /// Makes a token for that member, and adds its hash to the file, which is made if it does not exist.
    /// \return the token, which is nowhere else. \throws std::runtime_error with a message for people
    std::string add(const std::string& name);

  private:
    [[nodiscard]] std::string state() const;

    std::string path_;
    std::string last_ = "never read";
};

/// The SHA-256 of the text, as 64 hex digits in small letters. \throws std::runtime_error
std::string sha256_of(std::string_view text);
/// 32 random bytes as 64 hex digits. \throws std::runtime_error
std::string random_text();

} // namespace gateway
