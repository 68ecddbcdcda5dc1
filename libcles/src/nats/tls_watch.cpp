// SPDX-License-Identifier: BSL-1.0
#include "nats/tls_watch.hpp"

#include <nats/nats.h>
#include <openssl/crypto.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509_vfy.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <utility>

#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/time.h>

namespace cles::nats {
namespace {

constexpr std::size_t record_head = 5;
constexpr int longest_record = 16'384 + 256; // without its head

// The library does not say which context it has made, but OpenSSL reports each new one to the thread that makes it.
thread_local SSL_CTX** made_here = nullptr;

void on_context(void* context, void*, CRYPTO_EX_DATA*, int, long, void*) {
    if (made_here != nullptr) {
        *made_here = static_cast<SSL_CTX*>(context);
    }
}

int watch_index() {
    static const int index =
        ::CRYPTO_get_ex_new_index(CRYPTO_EX_INDEX_SSL_CTX, 0, nullptr, &on_context, nullptr, nullptr);
    return index;
}

} // namespace

struct tls_watch::callbacks {
    static void on_state(const SSL* connection, int where, int) {
        auto* const self = static_cast<tls_watch*>(::SSL_CTX_get_ex_data(::SSL_get_SSL_CTX(connection), watch_index()));
        if (self == nullptr || (where & SSL_CB_HANDSHAKE_START) == 0) {
            return;
        }
        self->used_ = true;
        const auto seconds = std::chrono::floor<std::chrono::seconds>(self->limit_);
        const timeval limit{.tv_sec = seconds.count(),
                            .tv_usec = std::chrono::microseconds{self->limit_ - seconds}.count()};
        const int socket = ::SSL_get_fd(connection); // it blocks until the handshake is done
        ::fcntl(socket, F_SETFD, FD_CLOEXEC);
        static_cast<void>(::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit));
        static_cast<void>(::setsockopt(socket, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit));
    }
};

void tls_watch::keep_openssl() noexcept { ::OPENSSL_init_crypto(OPENSSL_INIT_NO_ATEXIT, nullptr); }

bool tls_watch::prepare(natsOptions* options, bool system_authorities) {
    used_ = false;
    awaited_ = 1;
    ::ERR_clear_error();
    SSL_CTX* context = nullptr;
    const int index = watch_index();
    made_here = &context;
    const auto code = natsOptions_SkipServerVerification(options, false); // makes the context, and requires nothing
    made_here = nullptr;
    if (index < 0 || code != NATS_OK || context == nullptr) {
        return false;
    }
    if (!system_authorities) {
        auto* const none = ::X509_STORE_new();
        if (none == nullptr) {
            return false;
        }
        ::SSL_CTX_set_cert_store(context, none); // which owns it
    }
    ::SSL_CTX_set_mode(context, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
    ::SSL_CTX_set_info_callback(context, &callbacks::on_state);
    return ::SSL_CTX_set_ex_data(context, index, this) == 1;
}

bool tls_watch::has_record(int socket) noexcept {
    std::array<unsigned char, record_head> head{};
    const auto got = ::recv(socket, head.data(), head.size(), MSG_PEEK | MSG_DONTWAIT);
    if (got <= 0) {
        return got == 0 || errno != EAGAIN; // the library finds out why
    }
    int needed = record_head;
    if (std::cmp_equal(got, record_head)) {
        const int length = head[3] << 8U | head[4];
        if (length > longest_record) {
            return true; // it is no record
        }
        needed += length;
    }
    int available = 0;
    if (::ioctl(socket, FIONREAD, &available) != 0) {
        return true;
    }
    const bool is_whole = got == static_cast<ssize_t>(record_head) && available >= needed;
    const int awaited = is_whole ? 1 : needed;
    if (awaited != std::exchange(awaited_, awaited)) {
        static_cast<void>(::setsockopt(socket, SOL_SOCKET, SO_RCVLOWAT, &awaited, sizeof awaited));
        return is_whole;
    }
    // Readable before that: the socket has no memory for more until something is read. The rest follows at once then.
    return true;
}

std::string tls_watch::last_error() {
    const auto* const words = ::ERR_reason_error_string(::ERR_peek_last_error());
    return words == nullptr ? std::string{} : std::string{words};
}

} // namespace cles::nats
