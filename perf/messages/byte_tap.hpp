// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/url.hpp>

#include "perf/support/bare_socket.hpp"
#include "relay_thread.hpp"

#include <atomic>
#include <cstdint>
#include <string>

namespace cles::perf {

/// A relay between the two ends of one link that counts the bytes of the stream, without the headers of TCP and IP. So
/// figures do not depend on what an end reports.
class byte_tap {
  public:
    /// Listens for the link that it forwards to a `tcp` or `unix` URL.
    /// \throws std::system_error, std::runtime_error if the URL cannot be reached
    explicit byte_tap(const cles::url& target);

    /// Where to connect instead.
    [[nodiscard]] std::string url() const;
    [[nodiscard]] std::uint64_t to_server() const noexcept { return to_server_; }
    [[nodiscard]] std::uint64_t to_client() const noexcept { return to_client_; }

  private:
    void run(int stop);

    listener listener_;
    descriptor server_;
    std::atomic<std::uint64_t> to_server_{0};
    std::atomic<std::uint64_t> to_client_{0};
    relay_thread relay_{[this](int stop) { run(stop); }}; // the last member: it uses the others
};

} // namespace cles::perf
