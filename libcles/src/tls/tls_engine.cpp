// SPDX-License-Identifier: BSL-1.0
#include "tls/tls_engine.hpp"

#include "tls/tls_error.hpp"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>

#include <algorithm>
#include <cstring>
#include <string>

namespace cles::tls {
namespace {

constexpr std::size_t initial_input = 4096;
constexpr std::size_t openssl_buffers = 34'000; // roughly: one record in each direction

// A peer may change its keys, or send another message of the handshake, so often after it: this many times, and once
// for so many bytes that it sends.
constexpr std::uint64_t spare_messages = 16;
constexpr std::uint64_t bytes_per_message = 65536;

// RFC 8446, section 5.5, permits 2^24.5 records of full size with one key of AES-GCM.
constexpr std::uint64_t records_per_key = std::uint64_t{1} << 23U;
constexpr std::size_t record_size = 16384;

} // namespace

/// How OpenSSL reads and writes an engine's bytes.
struct engine_bio {
    static tls_engine& engine_of(BIO* bio) { return *static_cast<tls_engine*>(::BIO_get_data(bio)); }

    static int write(BIO* bio, const char* bytes, std::size_t size, std::size_t* written) {
        engine_of(bio).encrypted_.append(bytes, size);
        *written = size;
        return 1;
    }
    static int read(BIO* bio, char* space, std::size_t size, std::size_t* count) {
        auto& engine = engine_of(bio);
        ::BIO_clear_retry_flags(bio);
        *count = std::min(size, engine.end_ - engine.begin_);
        if (*count == 0) {
            ::BIO_set_retry_read(bio);
            return 0;
        }
        std::memcpy(space, engine.input_.get() + engine.begin_, *count);
        engine.begin_ += *count;
        return 1;
    }
    static long control(BIO*, int command, long, void*) { return command == BIO_CTRL_FLUSH ? 1 : 0; }

    static BIO* make(tls_engine& engine) {
        // Never freed, because engines in static objects use it until they are destroyed.
        static const BIO_METHOD* const method = [] {
            auto* const made = ::BIO_meth_new(::BIO_get_new_index() | BIO_TYPE_SOURCE_SINK, "cles");
            if (made != nullptr) {
                ::BIO_meth_set_write_ex(made, write);
                ::BIO_meth_set_read_ex(made, read);
                ::BIO_meth_set_ctrl(made, control);
            }
            return made;
        }();
        auto* bio = method != nullptr ? ::BIO_new(method) : nullptr;
        if (bio != nullptr) {
            ::BIO_set_data(bio, &engine);
            ::BIO_set_init(bio, 1);
        }
        return bio;
    }

    static void on_message(int sent, int, int type, const void*, std::size_t, SSL*, void* engine) {
        auto& of = *static_cast<tls_engine*>(engine);
        if (sent == 0 && type == SSL3_RT_HANDSHAKE && of.established_) {
            ++of.handshake_messages_;
        }
    }
};

void tls_engine::free_ssl::operator()(ssl_st* ssl) const noexcept { ::SSL_free(ssl); }

tls_engine::~tls_engine() = default;

// False if there is no memory.
bool tls_engine::begin() {
    ssl_.reset(::SSL_new(shared_.get()));
    auto* bio = ssl_ ? engine_bio::make(*this) : nullptr;
    if (bio == nullptr) {
        return false;
    }
    ::SSL_set_bio(ssl_.get(), bio, bio);
    ::SSL_set_msg_callback(ssl_.get(), engine_bio::on_message);
    ::SSL_set_msg_callback_arg(ssl_.get(), this);
    if (role_ == role::client) {
        ::SSL_set_connect_state(ssl_.get());
    } else {
        ::SSL_set_accept_state(ssl_.get());
    }
    return true;
}

std::span<char> tls_engine::prepare() {
    if (begin_ == end_) {
        // What filled the space will probably do so again.
        const auto wanted = capacity_ == 0 ? initial_input : end_ == capacity_ ? capacity_ * 4 : capacity_;
        if (const auto capacity = std::min(wanted, max_input_); capacity != capacity_) {
            input_.reset(new char[capacity]); // uninitialised on purpose
            capacity_ = capacity;
        }
        begin_ = end_ = 0;
    }
    return {input_.get() + end_, capacity_ - end_};
}

tls_engine::status tls_engine::status_of(int result, boost::system::error_code& why) {
    switch (::SSL_get_error(ssl_.get(), result)) {
    case SSL_ERROR_WANT_READ: return status::need_input;
    case SSL_ERROR_ZERO_RETURN: ended_ = true; return status::ended;
    default: break;
    }
    failed_ = true;
    why = take_openssl_error();
    return status::failed;
}

tls_engine::status tls_engine::shake_hands(boost::system::error_code& why) {
    ::ERR_clear_error();
    if (!ssl_ && !begin()) {
        failed_ = true;
        why = take_openssl_error();
        return status::failed;
    }
    has_buffers_ = true;
    const int result = ::SSL_do_handshake(ssl_.get());
    if (result != 1) {
        return status_of(result, why);
    }
    const unsigned char* protocol = nullptr;
    unsigned int length = 0;
    ::SSL_get0_alpn_selected(ssl_.get(), &protocol, &length);
    if (std::string_view{reinterpret_cast<const char*>(protocol), length} != "cles/1" || !note_peer_key()) {
        failed_ = true;
        why = tls_errc::other_protocol;
        return status::failed;
    }
    established_ = true;
    return status::done;
}

bool tls_engine::note_peer_key() {
    const auto* certificate = ::SSL_get0_peer_certificate(ssl_.get());
    const auto* key = certificate == nullptr ? nullptr : ::X509_get0_pubkey(certificate);
    std::size_t size = peer_key_.size();
    return key != nullptr && ::EVP_PKEY_get_id(key) == EVP_PKEY_ED25519 &&
           ::EVP_PKEY_get_raw_public_key(key, peer_key_.data(), &size) == 1 && size == peer_key_.size();
}

tls_engine::status tls_engine::read(std::span<char> space, std::size_t& count, boost::system::error_code& why) {
    if (ended_) {
        return status::ended;
    }
    if (begin_ == end_ && ::SSL_pending(ssl_.get()) == 0) { // most calls; OpenSSL would take longer to say so
        return status::need_input;
    }
    ::ERR_clear_error();
    has_buffers_ = true;
    const int result = ::SSL_read_ex(ssl_.get(), space.data(), space.size(), &count);
    if (handshake_messages_ > spare_messages + read_ / bytes_per_message) {
        failed_ = true;
        why = tls_errc::too_many_keys;
        return status::failed;
    }
    if (result != 1) {
        return status_of(result, why);
    }
    read_ += count;
    return status::done;
}

void tls_engine::write(std::string_view text, boost::system::error_code& why) {
    if (text.empty()) {
        return;
    }
    if (!established_) {
        why = tls_errc::failed;
        return;
    }
    has_buffers_ = true;
    if (written_ >= records_per_key) {
        ::SSL_key_update(ssl_.get(), SSL_KEY_UPDATE_NOT_REQUESTED);
        written_ = 0;
    }
    written_ += (text.size() + record_size - 1) / record_size;
    std::size_t count = 0;
    if (failed_ || ::SSL_write_ex(ssl_.get(), text.data(), text.size(), &count) != 1) {
        failed_ = true;
        why = tls_errc::failed;
        ::ERR_clear_error();
    }
}

void tls_engine::finish() {
    if (established_ && !failed_) {
        ::ERR_clear_error();
        ::SSL_shutdown(ssl_.get());
    }
}

std::size_t tls_engine::buffered() const noexcept {
    return capacity_ + encrypted_.capacity() + (has_buffers_ ? openssl_buffers : 0);
}

void tls_engine::shrink() {
    if (ssl_ && ::SSL_free_buffers(ssl_.get()) == 1) {
        has_buffers_ = false;
    }
    if (encrypted_.empty()) {
        std::string{}.swap(encrypted_);
    }
    if (begin_ == end_ && capacity_ > initial_input) {
        input_.reset();
        capacity_ = begin_ = end_ = 0;
    }
}

} // namespace cles::tls
