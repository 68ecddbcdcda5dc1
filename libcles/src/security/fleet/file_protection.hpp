// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

struct stat;

/// Opened files, and who can change them. Messages name what is wrong, and the command that mends it.

namespace cles::security {

/// An open file or folder.
class descriptor {
  public:
    descriptor() = default;
    explicit descriptor(int fd) noexcept : fd_(fd) {}
    descriptor(descriptor&& other) noexcept;
    descriptor& operator=(descriptor&& other) noexcept;
    ~descriptor();

    [[nodiscard]] int get() const noexcept { return fd_; }
    /// From now on somebody else closes it.
    [[nodiscard]] int release() noexcept;
    [[nodiscard]] bool is_open() const noexcept { return fd_ >= 0; }

  private:
    int fd_ = -1;
};

/// \param code that of `errno` \throws security_error
[[noreturn]] void fail_with(int code, const std::string& what);

/// \param path for the message \throws security_error
struct stat status_of(const descriptor& file, const std::string& path);

/// For commands that a message proposes.
std::string shell_quoted(std::string_view text);

/// The name, or else the number.
std::string user_name(std::uint32_t user);

/// What is wrong if the file belongs neither to this user nor to root; empty if nothing is.
std::string owner_flaw(const struct stat& status, const std::string& path);

/// What is wrong if the group or others may write; empty if nothing is.
std::string mode_flaw(const struct stat& status, const std::string& path);

struct user_entry {
    std::string name{};
    std::uint32_t group = 0; ///< the primary one
};

struct group_entry {
    std::string name{};
    std::uint32_t id = 0;
    std::vector<std::string> members{}; ///< besides those whose primary group it is
};

/// Whether the group is the owner's own one, as many systems create it for each user, and nobody else is in it.
/// \param users those that the system lists
bool is_private_group(const group_entry& group, const user_entry& owner, const std::vector<user_entry>& users);

/// Whether the file's group is the private one of its owner, as the system's database has it.
bool has_private_group(const struct stat& status);

} // namespace cles::security
