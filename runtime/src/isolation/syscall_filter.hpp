// SPDX-License-Identifier: BSL-1.0
#pragma once

namespace cles::runtime {

/// From now on, the calling thread and what it starts get EPERM from system calls that no plugin needs and that reach
/// beyond their process: tracing and signalling other processes, mounting, loading code into the kernel, changing the
/// clock, the host's name or namespaces, rebooting. \pre no new privileges
/// \return false if the kernel has no filters, or the processor is not known here; then nothing is refused
bool filter_syscalls();

} // namespace cles::runtime
