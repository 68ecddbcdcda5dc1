// SPDX-License-Identifier: BSL-1.0
#include "isolation/syscall_filter.hpp"

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
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

constexpr std::array refused_calls{
    // other processes
    SYS_ptrace,
    SYS_process_vm_readv,
    SYS_process_vm_writev,
    SYS_pidfd_send_signal,
    SYS_pidfd_getfd,
    SYS_kcmp,
    SYS_rt_sigqueueinfo,
    SYS_rt_tgsigqueueinfo,
    SYS_tkill,
    SYS_perf_event_open,
    // file systems
    SYS_mount,
    SYS_umount2,
    SYS_pivot_root,
    SYS_chroot,
    SYS_fsopen,
    SYS_fsmount,
    SYS_fsconfig,
    SYS_fspick,
    SYS_move_mount,
    SYS_open_tree,
    SYS_open_by_handle_at,
    SYS_name_to_handle_at,
    SYS_quotactl,
    SYS_swapon,
    SYS_swapoff,
    SYS_acct,
    // the kernel
    SYS_init_module,
    SYS_finit_module,
    SYS_delete_module,
    SYS_kexec_load,
    SYS_bpf,
    SYS_userfaultfd,
    SYS_io_uring_setup,
    SYS_add_key,
    SYS_request_key,
    SYS_keyctl,
    SYS_syslog,
    SYS_vhangup,
    SYS_reboot,
    SYS_personality,
    // the host
    SYS_settimeofday,
    SYS_clock_settime,
    SYS_clock_adjtime,
    SYS_adjtimex,
    SYS_sethostname,
    SYS_setdomainname,
    SYS_unshare,
    SYS_setns,
};

sock_filter statement(std::uint16_t code, std::uint32_t value) { return {code, 0, 0, value}; }
sock_filter jump_if(std::uint16_t test, std::uint32_t value, std::uint8_t then, std::uint8_t otherwise) {
    return {static_cast<std::uint16_t>(BPF_JMP | test | BPF_K), then, otherwise, value};
}
sock_filter load(std::size_t offset) { return statement(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offset)); }

constexpr std::uint32_t allow_call = SECCOMP_RET_ALLOW;
constexpr std::uint32_t refuse_call = SECCOMP_RET_ERRNO | EPERM;

// Refuses a call unless its first argument is this number. \param number of the call
void allow_only(std::vector<sock_filter>& to, std::uint32_t number, std::uint32_t argument) {
    to.push_back(jump_if(BPF_JEQ, number, 0, 4));
    to.push_back(load(offsetof(seccomp_data, args)));
    to.push_back(jump_if(BPF_JEQ, argument, 0, 1));
    to.push_back(statement(BPF_RET | BPF_K, allow_call));
    to.push_back(statement(BPF_RET | BPF_K, refuse_call));
}

} // namespace

bool filter_syscalls() {
    if (own_architecture == 0) {
        return false;
    }
    const auto self = static_cast<std::uint32_t>(::getpid());
    std::vector<sock_filter> program{
        load(offsetof(seccomp_data, arch)),
        jump_if(BPF_JEQ, own_architecture, 1, 0),
        statement(BPF_RET | BPF_K, refuse_call),
        load(offsetof(seccomp_data, nr)),
    };
#if defined(__x86_64__)
    program.push_back(jump_if(BPF_JGE, x32_bit, 0, 1));
    program.push_back(statement(BPF_RET | BPF_K, refuse_call));
#endif
    // A process may end itself, as `abort` does.
    allow_only(program, SYS_kill, self);
    allow_only(program, SYS_tgkill, self);
    for (const auto number : refused_calls) {
        program.push_back(jump_if(BPF_JEQ, static_cast<std::uint32_t>(number), 0, 1));
        program.push_back(statement(BPF_RET | BPF_K, refuse_call));
    }
    program.push_back(statement(BPF_RET | BPF_K, allow_call));
    const sock_fprog filter{.len = static_cast<unsigned short>(program.size()), .filter = program.data()};
    return ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
}

} // namespace cles::runtime
