// SPDX-License-Identifier: BSL-1.0
#include "isolation/confinement.hpp"

#include "isolation/landlock.hpp"
#include "isolation/syscall_filter.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>

#include <linux/capability.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace cles::runtime {
namespace {

// Sanitizers reserve terabytes of address space, and keep memory of their own.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool limits_memory = false;
#else
constexpr bool limits_memory = true;
#endif

constexpr std::uint64_t own_files = 16; // and one for each thread

// Lower than the present limit, never higher.
void set_limit(__rlimit_resource what, rlim_t value, const char* name) {
    rlimit now{};
    ::getrlimit(what, &now);
    const auto lowered = std::min(value, now.rlim_max);
    const rlimit wanted{.rlim_cur = lowered, .rlim_max = lowered};
    if (::setrlimit(what, &wanted) != 0) {
        throw std::system_error(errno, std::generic_category(), std::string{"cannot limit the "} + name);
    }
}

// Memory that is only reserved does not count as data, but does count as address space: glibc reserves 64 MiB for each
// thread's heap. The second limit is for mappings that are shared, which are no data.
void limit_memory(const confinement& to) {
    constexpr std::uint64_t reserved_by_thread = 80U << 20U;
    constexpr std::uint64_t libraries = 512U << 20U;
    set_limit(RLIMIT_DATA, to.memory, "memory");
    set_limit(RLIMIT_AS, to.memory + libraries + (to.threads + 16) * reserved_by_thread, "address space");
}

// All of them, which matters if the daemon is root.
void drop_capabilities() {
    __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
    std::array<__user_cap_data_struct, _LINUX_CAPABILITY_U32S_3> none{};
    if (::syscall(SYS_capset, &header, none.data()) != 0) {
        throw std::system_error(errno, std::generic_category(), "cannot drop capabilities");
    }
}

std::string megabytes(std::uint64_t bytes) { return std::to_string(bytes >> 20U) + " MiB"; }

// What programs read on any system. Of /etc only these, because it may contain keys.
file_access files_of(const confinement& to, const std::filesystem::path& plugin) {
    return {.readable = {plugin,
                         "/lib",
                         "/lib32",
                         "/lib64",
                         "/usr/lib",
                         "/usr/lib64",
                         "/usr/local/lib",
                         "/usr/share",
                         "/proc",
                         "/sys",
                         "/etc/ld.so.cache",
                         "/etc/ld.so.preload",
                         "/etc/localtime",
                         "/etc/timezone",
                         "/etc/hosts",
                         "/etc/host.conf",
                         "/etc/resolv.conf",
                         "/etc/nsswitch.conf",
                         "/etc/gai.conf",
                         "/etc/services",
                         "/etc/protocols",
                         "/etc/passwd",
                         "/etc/group",
                         "/dev/random",
                         "/dev/urandom"},
            .writable = {"/dev/null", "/dev/zero", "/dev/full"},
            .required_readable = to.readable,
            .required_writable = to.writable};
}

} // namespace

std::string confine(const confinement& to, const std::filesystem::path& plugin) {
    if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) {
        throw std::system_error(errno, std::generic_category(), "cannot renounce new privileges");
    }
    drop_capabilities();
    set_limit(RLIMIT_CORE, 0, "size of core dumps");
    set_limit(RLIMIT_NOFILE, to.open_files + to.threads + own_files, "number of open files");
    if (limits_memory) {
        limit_memory(to);
    }
    std::string in_force = "no privileges, " + std::to_string(to.open_files) + " open files";
    in_force += limits_memory ? ", " + megabytes(to.memory) + " of memory" : ", no limit on memory (a sanitizer)";
    const auto version = limit_files(files_of(to, plugin));
    in_force += version > 0 ? ", files by Landlock " + std::to_string(version) : ", all files (no Landlock)";
    in_force += filter_syscalls() ? ", a filter of system calls" : ", all system calls (no seccomp)";
    return in_force;
}

} // namespace cles::runtime
