// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles::runtime {

/// From now on, the calling thread and what it starts get EPERM from system calls that no plugin needs and that reach
/// beyond their process: signalling, tracing and scheduling other processes, starting processes, whatever remains when
/// the process has ended, Unix sockets, the attributes of files, mounting, loading code into the kernel, changing the
/// clock, the host's name or namespaces, rebooting. \pre no new privileges
/// \param truncation whether files may be truncated by path
/// \return false if the kernel has no filters, or the processor is not known here; then nothing is refused
bool filter_syscalls(bool truncation);

} // namespace cles::runtime
