// SPDX-License-Identifier: BSL-1.0
#include "isolation/syscall_filter.hpp"

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/sched.h>
#include <linux/seccomp.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace cles::runtime {
namespace {

#if defined(__x86_64__)
constexpr std::uint32_t own_architecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t own_architecture = AUDIT_ARCH_AARCH64;
#elif defined(__riscv) && __riscv_xlen == 64
constexpr std::uint32_t own_architecture = AUDIT_ARCH_RISCV64;
#else
constexpr std::uint32_t own_architecture = 0;
#endif

// The 32-bit variants of x86-64 have other numbers.
constexpr std::uint32_t x32_bit = 0x40000000;

// Newer than the headers of many systems; the same on all processors.
constexpr int call_fchmodat2 = 452;
constexpr int call_setxattrat = 463;
constexpr int call_removexattrat = 466;
constexpr int call_file_setattr = 469;

// IOPRIO_WHO_PROCESS of <linux/ioprio.h>, which is not valid C++ in linux-libc-dev 6.1.192: a parameter is named
// `class`.
constexpr std::uint32_t priority_of_process = 1;

constexpr std::array refused_calls {
    // other processes
    SYS_ptrace, SYS_process_vm_readv, SYS_process_vm_writev, SYS_pidfd_send_signal, SYS_pidfd_getfd, SYS_kcmp,
        SYS_rt_sigqueueinfo, SYS_rt_tgsigqueueinfo, SYS_tkill, SYS_perf_event_open, SYS_process_madvise,
        SYS_migrate_pages, SYS_move_pages,
// processes of its own: they, and their sessions, could outlive it
#if defined(SYS_fork)
        SYS_fork, SYS_vfork,
#endif
        SYS_setsid, SYS_setpgid,
        // memory that no limit counts, or that remains
        SYS_memfd_create, SYS_shmget, SYS_semget, SYS_msgget, SYS_mq_open,
// attributes of files, which Landlock does not know
#if defined(SYS_chmod)
        SYS_chmod, SYS_chown, SYS_lchown, SYS_utime, SYS_utimes, SYS_futimesat,
#endif
        SYS_fchmod, SYS_fchmodat, call_fchmodat2, SYS_fchown, SYS_fchownat, SYS_utimensat, SYS_setxattr, SYS_lsetxattr,
        SYS_fsetxattr, call_setxattrat, SYS_removexattr, SYS_lremovexattr, SYS_fremovexattr, call_removexattrat,
        call_file_setattr,
        // file systems
        SYS_mount, SYS_umount2, SYS_pivot_root, SYS_chroot, SYS_fsopen, SYS_fsmount, SYS_fsconfig, SYS_fspick,
        SYS_move_mount, SYS_open_tree, SYS_open_by_handle_at, SYS_name_to_handle_at, SYS_quotactl, SYS_swapon,
        SYS_swapoff, SYS_acct,
        // the kernel
        SYS_init_module, SYS_finit_module, SYS_delete_module, SYS_kexec_load, SYS_bpf, SYS_userfaultfd,
        SYS_io_uring_setup, SYS_add_key, SYS_request_key, SYS_keyctl, SYS_syslog, SYS_vhangup, SYS_reboot,
        SYS_personality,
        // the host
        SYS_settimeofday, SYS_clock_settime, SYS_clock_adjtime, SYS_adjtimex, SYS_sethostname, SYS_setdomainname,
        SYS_unshare, SYS_setns,
};

using filter_code = std::vector<sock_filter>;

constexpr sock_filter statement(std::uint16_t code, std::uint32_t value) { return {code, 0, 0, value}; }
constexpr sock_filter jump_if(std::uint16_t test, std::uint32_t value, std::size_t then, std::size_t otherwise) {
    return {static_cast<std::uint16_t>(BPF_JMP | test | BPF_K), static_cast<std::uint8_t>(then),
            static_cast<std::uint8_t>(otherwise), value};
}
constexpr sock_filter load(std::size_t offset) {
    return statement(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offset));
}
// The kernel uses the lower half of all arguments that are examined here.
constexpr sock_filter load_argument(std::size_t index) {
    return load(offsetof(seccomp_data, args) + index * sizeof(seccomp_data::args[0]));
}

constexpr sock_filter allow_call = statement(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
constexpr sock_filter refuse_call = statement(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM);

// One result if the accumulator is one of these values, otherwise the other.
filter_code choose(std::initializer_list<std::uint32_t> values, sock_filter then, sock_filter otherwise) {
    filter_code made;
    for (const auto value : values) {
        made.push_back(jump_if(BPF_JEQ, value, values.size() - made.size(), 0));
    }
    made.push_back(otherwise);
    made.push_back(then);
    return made;
}

filter_code operator+(filter_code first, const filter_code& second) {
    first.insert(first.end(), second.begin(), second.end());
    return first;
}

// Refuses a call if that argument is one of these values, or unless it is.
filter_code refuse_values(std::size_t argument, std::initializer_list<std::uint32_t> values) {
    return filter_code{load_argument(argument)} + choose(values, refuse_call, allow_call);
}
filter_code allow_values(std::size_t argument, std::initializer_list<std::uint32_t> values) {
    return filter_code{load_argument(argument)} + choose(values, allow_call, refuse_call);
}

// What decides about one call.
void on_call(filter_code& to, int number, const filter_code& decide) {
    to.push_back(jump_if(BPF_JEQ, static_cast<std::uint32_t>(number), 0, decide.size()));
    to = std::move(to) + decide;
}

// A process may end itself, as `abort` does, and change its own limits and scheduling. (That of another thread of it
// cannot be told from that of another process.)
void allow_for_itself(filter_code& to) {
    const auto self = static_cast<std::uint32_t>(::getpid());
    for (const auto number : {SYS_kill, SYS_tgkill, SYS_prlimit64, SYS_sched_setaffinity, SYS_sched_setscheduler,
                              SYS_sched_setparam, SYS_sched_setattr}) {
        on_call(to, number, allow_values(0, {0, self}));
    }
    const auto own_priority = [&](std::uint32_t kind) {
        return filter_code{load_argument(0), jump_if(BPF_JEQ, kind, 1, 0), refuse_call} + allow_values(1, {0, self});
    };
    on_call(to, SYS_setpriority, own_priority(PRIO_PROCESS));
    on_call(to, SYS_ioprio_set, own_priority(priority_of_process));
}

// The owner of a descriptor gets signals, from versions of Landlock that do not limit these.
void refuse_owners(filter_code& to) {
    on_call(to, SYS_fcntl, refuse_values(1, {F_SETOWN, F_SETOWN_EX, F_SETSIG}));
    on_call(to, SYS_ioctl, refuse_values(1, {FIOSETOWN, SIOCSPGRP}));
}

void allow_only_threads(filter_code& to) {
    on_call(to, SYS_clone, {load_argument(0), jump_if(BPF_JSET, CLONE_THREAD, 1, 0), refuse_call, allow_call});
    // Its flags are in memory, which a filter cannot read. The C library then uses `clone`.
    on_call(to, SYS_clone3, {statement(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | ENOSYS)});
    on_call(to, SYS_prctl, refuse_values(0, {PR_SET_PDEATHSIG})); // it ends with the daemon
}

// Shared memory is no data (RLIMIT_DATA), so no limit counts it. A process that has no others needs none.
void refuse_shared_memory(filter_code& to) {
    constexpr std::uint32_t shared = MAP_SHARED | MAP_ANONYMOUS;
    on_call(to, SYS_mmap,
            {load_argument(3), statement(BPF_ALU | BPF_AND | BPF_K, shared), jump_if(BPF_JEQ, shared, 0, 1),
             statement(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | ENOMEM), allow_call});
}

// At Unix sockets, other programs take the daemon's user for the requester. Pairs that are connected to each other stay
// so.
void refuse_unix_sockets(filter_code& to) {
    constexpr std::uint32_t without_flags = 0xF;
    on_call(to, SYS_socket, refuse_values(0, {AF_UNIX}));
    on_call(to, SYS_socketpair,
            filter_code{load_argument(1), statement(BPF_ALU | BPF_AND | BPF_K, without_flags)} +
                choose({SOCK_STREAM, SOCK_SEQPACKET}, allow_call, refuse_call));
}

} // namespace

bool filter_syscalls(bool truncation) {
    if (own_architecture == 0) {
        return false;
    }
    filter_code all{load(offsetof(seccomp_data, arch)), jump_if(BPF_JEQ, own_architecture, 1, 0), refuse_call,
                    load(offsetof(seccomp_data, nr))};
#if defined(__x86_64__)
    all.push_back(jump_if(BPF_JGE, x32_bit, 0, 1));
    all.push_back(refuse_call);
#endif
    allow_for_itself(all);
    refuse_owners(all);
    allow_only_threads(all);
    refuse_unix_sockets(all);
    refuse_shared_memory(all);
    for (const auto number : refused_calls) {
        on_call(all, number, {refuse_call});
    }
    if (!truncation) {
        on_call(all, SYS_truncate, {refuse_call});
    }
    all.push_back(allow_call);
    const sock_fprog filter{.len = static_cast<unsigned short>(all.size()), .filter = all.data()};
    return ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

} // namespace cles::runtime
