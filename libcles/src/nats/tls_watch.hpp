// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <chrono>
#include <string>

using natsOptions = struct __natsOptions; // NOLINT: a name of libnats

namespace cles::nats {

/// The TLS of a connection to NATS. libnats has no time limit for the handshake; and if a read finds less than a
/// record, or a write more than the socket takes, it waits for the rest as long as that takes, in which time its timer
/// may destroy what is used. So the handshake gets a limit here, a write ends with each record, and `has_record`
/// is asked before each read. Used by one thread.
class tls_watch {
  public:
    /// `limit`: how long the handshake waits for the server each time.
    explicit tls_watch(std::chrono::milliseconds limit) noexcept : limit_(limit) {}
    tls_watch(const tls_watch&) = delete;
    tls_watch& operator=(const tls_watch&) = delete;

    /// Before the connection is made, which uses TLS if the options or the server demand it.
    /// \param system_authorities whether those of the system are trusted, too \returns whether that is possible
    [[nodiscard]] bool prepare(natsOptions* options, bool system_authorities);
    /// Whether the connection that was made last uses TLS.
    [[nodiscard]] bool is_used() const noexcept { return used_; }
    /// Whether a read does not have to wait, or only for what the server sends as soon as it is read. If not, the
    /// socket is not readable until then. \pre the socket is readable
    [[nodiscard]] bool has_record(int socket) noexcept;
    /// What OpenSSL says of the last failure; empty: nothing.
    /// To be called before OpenSSL is used: threads that are connected to NATS may outlive the functions of `atexit`.
    static void keep_openssl() noexcept;
    [[nodiscard]] static std::string last_error();

  private:
    struct callbacks;

    std::chrono::milliseconds limit_;
    bool used_ = false;
    int awaited_ = 1; // bytes, from which on the socket is readable
};

} // namespace cles::nats
