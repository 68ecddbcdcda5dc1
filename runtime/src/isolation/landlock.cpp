// SPDX-License-Identifier: BSL-1.0
#include "isolation/landlock.hpp"

#include "isolation/descriptor.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace cles::runtime {
namespace {

// From linux/landlock.h, which is older than the kernel on many systems. Each version has a prefix of these members.
struct ruleset_attributes {
    std::uint64_t handled_fs = 0;
    std::uint64_t handled_net = 0; // 4
    std::uint64_t scoped = 0;      // 6
};
struct [[gnu::packed]] path_rule {
    std::uint64_t allowed;
    std::int32_t parent;
};

constexpr unsigned version_query = 1;
constexpr int rule_of_path = 1;
constexpr std::uint64_t scope_abstract_sockets_and_signals = 1U << 0U | 1U << 1U;

constexpr std::uint64_t write_file = 1U << 1U;
constexpr std::uint64_t read_file = 1U << 2U;
constexpr std::uint64_t read_folder = 1U << 3U;
constexpr std::uint64_t truncate_file = 1U << 14U;  // 3
constexpr std::uint64_t control_device = 1U << 15U; // 5
constexpr std::uint64_t execute = 1U << 0U;
constexpr std::uint64_t make_special = 1U << 6U | 1U << 9U | 1U << 10U | 1U << 11U; // devices, sockets, pipes
// Those that a rule for something other than a folder may contain.
constexpr std::uint64_t of_files = execute | write_file | read_file | truncate_file | control_device;

// All rights of a version.
std::uint64_t rights_of(int version) noexcept {
    constexpr std::array<unsigned, 5> counts{13, 14, 15, 15, 16};
    const auto index = static_cast<std::size_t>(version) - 1;
    return (std::uint64_t{1} << counts[std::min(index, counts.size() - 1)]) - 1;
}

[[noreturn]] void throw_landlock_error(const std::string& what) {
    throw std::system_error(errno, std::generic_category(), what);
}

class ruleset {
  public:
    explicit ruleset(int version) : all_(rights_of(version)) {
        ruleset_attributes wanted{
            .handled_fs = all_, .handled_net = 0, .scoped = version >= 6 ? scope_abstract_sockets_and_signals : 0};
        const auto size = version >= 6   ? sizeof wanted
                          : version >= 4 ? offsetof(ruleset_attributes, scoped)
                                         : offsetof(ruleset_attributes, handled_net);
        rules_ = owned_descriptor{static_cast<int>(::syscall(SYS_landlock_create_ruleset, &wanted, size, 0))};
        if (rules_.get() < 0) {
            throw_landlock_error("cannot limit the files of a plugin");
        }
    }

    // Returns why the path cannot be opened, if so.
    [[nodiscard]] std::optional<std::string> allow(const std::filesystem::path& path, std::uint64_t rights) const {
        const owned_descriptor opened{::open(path.c_str(), O_PATH | O_CLOEXEC)};
        if (opened.get() < 0) {
            return path.string() + ": " + std::generic_category().message(errno);
        }
        struct stat status {};
        const bool is_folder = ::fstat(opened.get(), &status) == 0 && S_ISDIR(status.st_mode);
        const path_rule rule{.allowed = rights & all_ & (is_folder ? ~std::uint64_t{0} : of_files),
                             .parent = opened.get()};
        if (::syscall(SYS_landlock_add_rule, rules_.get(), rule_of_path, &rule, 0) != 0) {
            throw_landlock_error(path.string());
        }
        return std::nullopt;
    }

    void enforce() const {
        if (::syscall(SYS_landlock_restrict_self, rules_.get(), 0) != 0) {
            throw_landlock_error("cannot limit the files of a plugin");
        }
    }

  private:
    std::uint64_t all_;
    owned_descriptor rules_;
};

} // namespace

file_limits limit_files(const file_access& to) {
    const auto version = static_cast<int>(::syscall(SYS_landlock_create_ruleset, nullptr, 0, version_query));
    if (version <= 0) {
        return {}; // not built in, or not enabled
    }
    const ruleset rules{version};
    constexpr auto read = read_file | read_folder;
    constexpr auto write = ~(execute | make_special);
    const auto allow = [&rules](const auto& paths, std::uint64_t rights) {
        std::vector<std::string> missing;
        for (const auto& path : paths) {
            if (auto why = rules.allow(path, rights)) {
                missing.push_back(std::move(*why));
            }
        }
        return missing;
    };
    allow(to.system_readable, read);
    allow(to.system_writable, write);
    file_limits done{.version = version,
                     .missing_readable = allow(to.readable, read),
                     .missing_writable = allow(to.writable, write)};
    rules.enforce();
    return done;
}

} // namespace cles::runtime
