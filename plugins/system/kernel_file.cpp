// SPDX-License-Identifier: BSL-1.0
#include "kernel_file.hpp"

#include <cles/error.hpp>

#include <array>
#include <cerrno>

#include <fcntl.h>
#include <unistd.h>

namespace sysinfo {
namespace {

constexpr std::size_t most_bytes = 4U << 20U;

bool read_all(const char* path, std::string& out) {
    const int file = ::open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0) {
        return false;
    }
    std::array<char, 16384> some{};
    ssize_t size = 0;
    do {
        size = ::read(file, some.data(), some.size());
        if (size > 0) {
            out.append(some.data(), static_cast<std::size_t>(size));
        }
    } while ((size > 0 && out.size() < most_bytes) || (size < 0 && errno == EINTR));
    ::close(file);
    return size >= 0; // a process may go while its file is read
}

} // namespace

std::string read_kernel_file(const char* path, const char* what) {
    std::string text;
    if (!read_all(path, text)) {
        throw cles::error(cles::errc::failed, std::string{"this kernel does not report its "} + what);
    }
    return text;
}

std::string read_if_there(const char* path) {
    std::string text;
    return read_all(path, text) ? text : std::string{};
}

} // namespace sysinfo
