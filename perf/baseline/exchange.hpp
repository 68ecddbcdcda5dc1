// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "perf/support/bare_socket.hpp"
#include "perf/support/localization.hpp"

#include <cstdint>

/// The baseline: a packed struct over a stream or in a datagram, with blocking sockets, as a careful engineer writes it
/// by hand for one task.
namespace cles::perf::icd {

class server {
  public:
    explicit server(const url& where) : listener_(listen_on(where)) {}
    [[nodiscard]] const url& where() const noexcept { return listener_.where; }
    /// Serves one client after the other, or by datagrams all of them. Does not return.
    [[noreturn]] void run();

  private:
    void serve(int client);
    [[noreturn]] void serve_datagrams();

    listener listener_;
    std::uint64_t served_ = 0;
};

class client {
  public:
    explicit client(const url& where) : socket_(connect_to(where)) {}
    /// Sends the request and waits for the reply.
    /// \throws std::system_error, or std::runtime_error if it is not a valid reply
    localization pull();

  private:
    descriptor socket_;
};

} // namespace cles::perf::icd
