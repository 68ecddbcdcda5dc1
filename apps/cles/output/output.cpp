// SPDX-License-Identifier: BSL-1.0
#include "output/output.hpp"

#include "output/failure.hpp"

#include <cerrno>
#include <system_error>

#include <poll.h>
#include <unistd.h>

namespace tool {

void write_output(std::string_view text) {
    while (!text.empty()) {
        const auto written = ::write(STDOUT_FILENO, text.data(), text.size());
        if (written >= 0) {
            text.remove_prefix(static_cast<std::size_t>(written));
        } else if (errno == EAGAIN) { // another process that shares the pipe made it so
            pollfd out{STDOUT_FILENO, POLLOUT, 0};
            ::poll(&out, 1, -1);
        } else if (errno == EPIPE) {
            throw output_closed{};
        } else if (errno == EINTR) {
            throw output_interrupted{};
        } else {
            throw std::runtime_error("cannot write the output: " + std::generic_category().message(errno));
        }
    }
}

bool is_output_closed() {
    pollfd out{STDOUT_FILENO, 0, 0};
    return ::poll(&out, 1, 0) == 1 && (out.revents & (POLLERR | POLLHUP)) != 0;
}

} // namespace tool
