// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/url.hpp>

#include "perf/support/descriptor.hpp"
#include "relay_thread.hpp"

#include <atomic>
#include <cstdint>
#include <string>

namespace cles::perf {

/// The same as `byte_tap` for datagrams: a relay between one client and a node at a `udp` URL on loopback that counts
/// bytes without the headers of UDP and IP.
class datagram_tap {
  public:
    /// \throws std::system_error
    explicit datagram_tap(const cles::url& target);

    /// Where to send to instead.
    [[nodiscard]] std::string url() const;
    [[nodiscard]] std::uint64_t to_server() const noexcept { return to_server_; }
    [[nodiscard]] std::uint64_t to_client() const noexcept { return to_client_; }

  private:
    void run(int stop);

    descriptor client_;
    descriptor server_;
    std::atomic<std::uint64_t> to_server_{0};
    std::atomic<std::uint64_t> to_client_{0};
    relay_thread relay_{[this](int stop) { run(stop); }}; // the last member: it uses the others
};

} // namespace cles::perf
