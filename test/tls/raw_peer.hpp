// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/rsa.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>

#include <memory>
#include <string>
#include <string_view>

/// The other end of a TLS connection as OpenSSL alone would make it, so that tests can do what the product never does.

namespace cles::tls::test {

struct free_openssl {
    void operator()(SSL* ssl) const noexcept { ::SSL_free(ssl); }
    void operator()(SSL_CTX* context) const noexcept { ::SSL_CTX_free(context); }
    void operator()(EVP_PKEY* key) const noexcept { ::EVP_PKEY_free(key); }
    void operator()(X509* certificate) const noexcept { ::X509_free(certificate); }
};

enum class certificate { none, ed25519, rsa, ecdsa };

class raw_peer {
  public:
    explicit raw_peer(bool is_client, certificate kind = certificate::ed25519, std::string_view protocol = "\6cles/1")
        : context_(::SSL_CTX_new(::TLS_method())) {
        ::SSL_CTX_set_verify(context_.get(), SSL_VERIFY_PEER, [](int, X509_STORE_CTX*) { return 1; });
        if (kind != certificate::none) {
            use_certificate(kind);
        }
        if (!protocol.empty()) {
            ::SSL_CTX_set_alpn_protos(context_.get(), reinterpret_cast<const unsigned char*>(protocol.data()),
                                      static_cast<unsigned int>(protocol.size()));
            ::SSL_CTX_set_alpn_select_cb(
                context_.get(),
                [](SSL*, const unsigned char** out, unsigned char* length, const unsigned char* offered, unsigned int,
                   void*) {
                    *length = offered[0];
                    *out = offered + 1;
                    return SSL_TLSEXT_ERR_OK;
                },
                nullptr);
        }
        is_client_ = is_client;
    }

    [[nodiscard]] SSL_CTX* context() const noexcept { return context_.get(); }
    /// The connection, which the first call makes.
    SSL* ssl() {
        if (!ssl_) {
            ssl_.reset(::SSL_new(context_.get()));
            ::SSL_set_bio(ssl_.get(), ::BIO_new(::BIO_s_mem()), ::BIO_new(::BIO_s_mem()));
            if (is_client_) {
                ::SSL_set_connect_state(ssl_.get());
            } else {
                ::SSL_set_accept_state(ssl_.get());
            }
        }
        return ssl_.get();
    }
    /// Whether the handshake is complete; continues it.
    bool shake_hands() { return ::SSL_do_handshake(ssl()) == 1; }
    void receive(std::string_view bytes) {
        ::BIO_write(::SSL_get_rbio(ssl()), bytes.data(), static_cast<int>(bytes.size()));
    }
    /// What it has sent since the last call.
    std::string take_output() {
        char* bytes = nullptr;
        const auto size = BIO_get_mem_data(::SSL_get_wbio(ssl()), &bytes);
        std::string output{bytes, static_cast<std::size_t>(size)};
        static_cast<void>(BIO_reset(::SSL_get_wbio(ssl())));
        return output;
    }

  private:
    void use_certificate(certificate kind) {
        const std::unique_ptr<EVP_PKEY, free_openssl> key{kind == certificate::rsa ? EVP_RSA_gen(2048)
                                                          : kind == certificate::ecdsa
                                                              ? EVP_EC_gen("P-256")
                                                              : ::EVP_PKEY_Q_keygen(nullptr, nullptr, "ED25519")};
        const std::unique_ptr<X509, free_openssl> made{::X509_new()};
        ::X509_set_version(made.get(), X509_VERSION_3);
        ::X509_gmtime_adj(::X509_getm_notBefore(made.get()), 0);
        ::X509_gmtime_adj(::X509_getm_notAfter(made.get()), 3600);
        ::X509_set_pubkey(made.get(), key.get());
        ::X509_sign(made.get(), key.get(), kind == certificate::ed25519 ? nullptr : ::EVP_sha256());
        ::SSL_CTX_use_certificate(context_.get(), made.get());
        ::SSL_CTX_use_PrivateKey(context_.get(), key.get());
    }

    std::unique_ptr<SSL_CTX, free_openssl> context_;
    std::unique_ptr<SSL, free_openssl> ssl_;
    bool is_client_ = true;
};

} // namespace cles::tls::test
