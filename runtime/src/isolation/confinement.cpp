// SPDX-License-Identifier: BSL-1.0
#include "isolation/confinement.hpp"

#include "isolation/landlock.hpp"
#include "isolation/syscall_filter.hpp"
#include "plugins/plugin_error.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <system_error>

#include <linux/capability.h>
#include <pthread.h>
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

std::uint64_t stack_of_thread() {
    pthread_attr_t usual;
    std::size_t size = 0;
    ::pthread_getattr_default_np(&usual);
    ::pthread_attr_getstacksize(&usual, &size);
    ::pthread_attr_destroy(&usual);
    return size;
}

// The whole stack of a thread counts as data; those of the daemon's threads are not the plugin's. Memory that is only
// reserved does not count as data, but does count as address space: glibc reserves 64 MiB for each thread's heap.
// Memory that is shared is no data. The filter of system calls refuses it; where there is none, the second limit bounds
// it.
void limit_memory(std::uint64_t memory, std::size_t threads) {
    constexpr std::uint64_t heap_of_thread = 64U << 20U;
    constexpr std::uint64_t libraries = 512U << 20U;
    constexpr std::uint64_t other_threads = 16;
    const auto stack = stack_of_thread();
    set_limit(RLIMIT_DATA, memory + threads * stack, "memory");
    set_limit(RLIMIT_AS, memory + libraries + (threads + other_threads) * (heap_of_thread + stack), "address space");
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
file_access files_of(const isolation_limits& to, const std::filesystem::path& plugin) {
    return {.system_readable = {plugin,
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
            // Not /dev/zero: mapped, it is shared memory.
            .system_writable = {"/dev/null", "/dev/full"},
            .readable = to.read,
            .writable = to.write};
}

} // namespace

confinement_report confine(const isolation_limits& to, std::size_t threads, const std::filesystem::path& plugin,
                           bool require_paths) {
    if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) {
        throw std::system_error(errno, std::generic_category(), "cannot renounce new privileges");
    }
    drop_capabilities();
    set_limit(RLIMIT_CORE, 0, "size of core dumps");
    set_limit(RLIMIT_NOFILE, to.open_files + threads + own_files, "number of open files");
    if (limits_memory) {
        limit_memory(to.memory, threads);
    }
    confinement_report done{.in_force = "no privileges, " + std::to_string(to.open_files) + " open files"};
    done.in_force += limits_memory ? ", " + megabytes(to.memory) + " of memory" : ", no limit on memory (a sanitizer)";
    const auto files = limit_files(files_of(to, plugin));
    if (files.version > 0) {
        done.in_force += ", files by Landlock " + std::to_string(files.version);
    } else {
        done.missing.emplace_back(
            "it can use all files of the daemon's user, and /dev/zero as memory that its limit does "
            "not count, because the kernel has no Landlock");
    }
    constexpr int limits_truncation = 3;
    if (filter_syscalls(files.version >= limits_truncation)) {
        done.in_force += ", a filter of system calls";
    } else {
        done.missing.emplace_back(
            "it can use all system calls, and more memory than its limit if it shares it, because "
            "the kernel has no filter for this processor");
    }
    const auto report_missing = [&](const std::vector<std::string>& paths, const char* key) {
        for (const auto& path : paths) {
            if (require_paths) {
                throw plugin_error(plugin.string(), path, key);
            }
            done.missing.push_back("it cannot use a path of its '" + std::string{key} + "': " + path);
        }
    };
    report_missing(files.missing_readable, "limits.read");
    report_missing(files.missing_writable, "limits.write");
    return done;
}

} // namespace cles::runtime
