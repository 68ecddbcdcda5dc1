// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <string_view>
#include <utility>

#include <unistd.h>

namespace cles::runtime {

/// Owns a file descriptor.
class owned_descriptor {
  public:
    owned_descriptor() = default;
    explicit owned_descriptor(int fd) noexcept : fd_(fd) {}
    owned_descriptor(owned_descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
    owned_descriptor& operator=(owned_descriptor&& other) noexcept {
        if (this != &other) {
            close();
            fd_ = std::exchange(other.fd_, -1);
        }
        return *this;
    }
    ~owned_descriptor() { close(); }

    [[nodiscard]] int get() const noexcept { return fd_; }
    [[nodiscard]] int release() noexcept { return std::exchange(fd_, -1); }
    void close() noexcept {
        if (fd_ >= 0) {
            ::close(std::exchange(fd_, -1));
        }
    }

  private:
    int fd_ = -1;
};

struct pipe_ends {
    owned_descriptor from; ///< does not block
    owned_descriptor into; ///< blocks, so that no output is lost
};
/// Sends all to a connected socket that blocks. Returns 0, or the error (errno).
[[nodiscard]] int send_all(int socket, std::string_view text) noexcept;

/// A pipe whose ends are closed by `exec`. \throws std::system_error
pipe_ends make_pipe();

} // namespace cles::runtime
