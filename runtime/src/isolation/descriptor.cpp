// SPDX-License-Identifier: BSL-1.0
#include "isolation/descriptor.hpp"

#include <array>
#include <cerrno>
#include <cstddef>
#include <system_error>

#include <fcntl.h>
#include <sys/socket.h>

namespace cles::runtime {

pipe_ends make_pipe() {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
        throw std::system_error(errno, std::generic_category(), "cannot create a pipe");
    }
    pipe_ends made{.from = owned_descriptor{ends[0]}, .into = owned_descriptor{ends[1]}};
    if (::fcntl(made.from.get(), F_SETFL, O_NONBLOCK) != 0) {
        throw std::system_error(errno, std::generic_category(), "cannot create a pipe");
    }
    return made;
}

int send_all(int socket, std::string_view text) noexcept {
    while (!text.empty()) {
        const auto sent = ::send(socket, text.data(), text.size(), MSG_NOSIGNAL);
        if (sent >= 0) {
            text.remove_prefix(static_cast<std::size_t>(sent));
        } else if (errno != EINTR) {
            return errno;
        }
    }
    return 0;
}

} // namespace cles::runtime
