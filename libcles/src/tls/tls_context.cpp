// SPDX-License-Identifier: BSL-1.0
#include "tls/tls_context.hpp"

#include "tls/tls_error.hpp"

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>

#include <array>
#include <string>
#include <string_view>

#include <sys/resource.h>

namespace cles::tls {
namespace {

struct free_key {
    void operator()(EVP_PKEY* key) const noexcept { ::EVP_PKEY_free(key); }
};
struct free_certificate {
    void operator()(X509* certificate) const noexcept { ::X509_free(certificate); }
};
using key_ptr = std::unique_ptr<EVP_PKEY, free_key>;
using certificate_ptr = std::unique_ptr<X509, free_certificate>;

// In the form of ALPN: each name after its length.
constexpr std::array<unsigned char, 7> application_protocol{6, 'c', 'l', 'e', 's', '/', '1'};
constexpr long max_certificate = 8192; // bytes of what the other end sends as its certificate
// Space for 32,768 keys: OpenSSL keeps one of each link that was accepted. Pages are locked when they are first used.
constexpr std::size_t most_secure_heap = std::size_t{1} << 20U;
constexpr std::size_t least_secure_heap = std::size_t{1} << 14U;
constexpr std::size_t secure_block = 32;

// Services in static objects use OpenSSL until they are destroyed, which may be after the functions of `atexit` have
// run.
ssl_ctx_st* make_context() {
    ::OPENSSL_init_crypto(OPENSSL_INIT_NO_ATEXIT, nullptr);
    return ::SSL_CTX_new(::TLS_method());
}

void require(bool succeeded, std::string_view what) {
    if (!succeeded) {
        throw security::security_error{std::string{what} + ": " + take_openssl_error().message()};
    }
}

// It is locked as a whole, so it has to fit into what this process may lock.
std::size_t secure_heap() noexcept {
    rlimit limit{};
    auto size = most_secure_heap;
    if (::getrlimit(RLIMIT_MEMLOCK, &limit) == 0) {
        while (size > least_secure_heap && size > limit.rlim_cur / 2) {
            size /= 2;
        }
    }
    return size;
}

// Private keys are on OpenSSL's secure heap, if it exists: locked, and not in core dumps.
void prepare_secure_heap() {
    static const bool prepared = [] {
        return ::CRYPTO_secure_malloc_initialized() != 0 ||
               ::CRYPTO_secure_malloc_init(secure_heap(), secure_block) != 0;
    }();
    static_cast<void>(prepared); // without it, the key is still wiped
}

// What OpenSSL makes of the bytes of a key is on its usual heap, and only a copy of that on the secure one. The first
// is wiped here.
key_ptr private_key_of(const security::signing_key& own) {
    prepare_secure_heap();
    const key_ptr made{::EVP_PKEY_new_raw_private_key(EVP_PKEY_ED25519, nullptr, own.seed().data(), own.seed().size())};
    require(made != nullptr, "cannot use the key for TLS");
    key_ptr kept{::EVP_PKEY_dup(made.get())};
    require(kept != nullptr, "cannot use the key for TLS");
    return kept;
}

certificate_ptr make_certificate(EVP_PKEY* key) {
    certificate_ptr made{::X509_new()};
    require(made != nullptr, "cannot make a certificate");
    auto* name = ::X509_get_subject_name(made.get());
    const std::array<unsigned char, 4> common_name{'c', 'l', 'e', 's'};
    require(::X509_set_version(made.get(), X509_VERSION_3) == 1 &&
                ::ASN1_INTEGER_set(::X509_get_serialNumber(made.get()), 1) == 1 &&
                ::ASN1_TIME_set_string_X509(::X509_getm_notBefore(made.get()), "19700101000000Z") == 1 &&
                ::ASN1_TIME_set_string_X509(::X509_getm_notAfter(made.get()), "99991231235959Z") == 1 &&
                ::X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC, common_name.data(),
                                             static_cast<int>(common_name.size()), -1, 0) == 1 &&
                ::X509_set_issuer_name(made.get(), name) == 1 && ::X509_set_pubkey(made.get(), key) == 1 &&
                ::X509_sign(made.get(), key, nullptr) > 0,
            "cannot make a certificate");
    return made;
}

// There is no chain and no time: the roster decides about the key, later.
int accept_ed25519(X509_STORE_CTX* checked, void*) {
    const auto* certificate = ::X509_STORE_CTX_get0_cert(checked);
    const auto* key = certificate == nullptr ? nullptr : ::X509_get0_pubkey(certificate);
    if (key != nullptr && ::EVP_PKEY_get_id(key) == EVP_PKEY_ED25519) {
        return 1;
    }
    ::X509_STORE_CTX_set_error(checked, X509_V_ERR_CERT_REJECTED);
    return 0;
}

int select_protocol(SSL*, const unsigned char** out, unsigned char* length, const unsigned char* offered,
                    unsigned int size, void*) {
    unsigned char* selected = nullptr;
    if (::SSL_select_next_proto(&selected, length, application_protocol.data(),
                                static_cast<unsigned int>(application_protocol.size()), offered,
                                size) != OPENSSL_NPN_NEGOTIATED) {
        return SSL_TLSEXT_ERR_ALERT_FATAL;
    }
    *out = selected;
    return SSL_TLSEXT_ERR_OK;
}

} // namespace

void tls_context::free_context::operator()(ssl_ctx_st* context) const noexcept { ::SSL_CTX_free(context); }

tls_context::tls_context(const security::signing_key& own) : context_(make_context()) {
    auto* context = context_.get();
    require(context != nullptr, "cannot prepare TLS");
    const auto key = private_key_of(own);
    const auto certificate = make_certificate(key.get());

    std::string group{"X25519"}; // these macros take no constants
    std::string signatures{"ed25519"};
    require(::SSL_CTX_set_min_proto_version(context, TLS1_3_VERSION) == 1 &&
                ::SSL_CTX_set_max_proto_version(context, TLS1_3_VERSION) == 1 &&
                ::SSL_CTX_set_ciphersuites(
                    context, "TLS_AES_128_GCM_SHA256:TLS_CHACHA20_POLY1305_SHA256:TLS_AES_256_GCM_SHA384") == 1 &&
                ::SSL_CTX_set1_groups_list(context, group.data()) == 1 &&
                ::SSL_CTX_set1_sigalgs_list(context, signatures.data()) == 1 &&
                ::SSL_CTX_set1_client_sigalgs_list(context, signatures.data()) == 1 &&
                ::SSL_CTX_use_certificate(context, certificate.get()) == 1 &&
                ::SSL_CTX_use_PrivateKey(context, key.get()) == 1 && ::SSL_CTX_set_num_tickets(context, 0) == 1 &&
                ::SSL_CTX_set_alpn_protos(context, application_protocol.data(),
                                          static_cast<unsigned int>(application_protocol.size())) == 0,
            "cannot prepare TLS");
    ::SSL_CTX_set_alpn_select_cb(context, select_protocol, nullptr);
    ::SSL_CTX_set_options(context, SSL_OP_NO_TICKET | SSL_OP_NO_COMPRESSION);
    ::SSL_CTX_set_session_cache_mode(context, SSL_SESS_CACHE_OFF);
    ::SSL_CTX_set_max_early_data(context, 0);
    ::SSL_CTX_set_recv_max_early_data(context, 0);
    ::SSL_CTX_set_max_cert_list(context, max_certificate);
    ::SSL_CTX_set_verify(context, SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, nullptr);
    ::SSL_CTX_set_cert_verify_callback(context, accept_ed25519, nullptr);
}

} // namespace cles::tls
