// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys/keys.hpp"

#include <memory>

struct ssl_ctx_st;

namespace cles::tls {

/// What all TLS connections of a node share (docs/protocol_security.md, "Streams"): its self-signed certificate, made
/// from its key, and what is negotiated: TLS 1.3, X25519, Ed25519 at both ends, `cles/1`, and no resumption of any
/// kind.
class tls_context {
  public:
    /// \throws security::security_error if OpenSSL refuses
    explicit tls_context(const security::signing_key& own);

    [[nodiscard]] ssl_ctx_st* get() const noexcept { return context_.get(); }

  private:
    struct free_context {
        void operator()(ssl_ctx_st* context) const noexcept;
    };
    std::unique_ptr<ssl_ctx_st, free_context> context_;
};

} // namespace cles::tls
