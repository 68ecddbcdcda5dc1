// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/url.hpp>

#include "perf/support/bare_socket.hpp"

#include <atomic>
#include <cstdint>
#include <string>
#include <thread>

namespace cles::perf {

/// Stands between the two ends of one link and counts what crosses it, so that no figure rests on what an end believes
/// that it sent. Counted are the stream's bytes, without the headers of TCP and IP.
class byte_tap {
  public:
    /// Listens for the one link that it passes on to a `tcp` or `unix` URL.
    /// \throws std::system_error, std::runtime_error where the URL cannot be reached
    explicit byte_tap(const cles::url& target);
    byte_tap(const byte_tap&) = delete;
    byte_tap& operator=(const byte_tap&) = delete;
    ~byte_tap();

    /// Where to connect instead.
    [[nodiscard]] std::string url() const;
    [[nodiscard]] std::uint64_t to_server() const noexcept { return to_server_; }
    [[nodiscard]] std::uint64_t to_client() const noexcept { return to_client_; }

  private:
    void run();

    listener listener_;
    descriptor server_;
    descriptor stop_here_;
    descriptor stop_;
    std::atomic<std::uint64_t> to_server_{0};
    std::atomic<std::uint64_t> to_client_{0};
    std::thread relay_;
};

} // namespace cles::perf
