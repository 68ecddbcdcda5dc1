// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/keys/keys.hpp"
#include "tls/tls_context.hpp"
#include "transport/stream_codec.hpp"

#include <boost/system/error_code.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

struct ssl_st;

namespace cles::tls {

/// One TLS connection, sans-I/O: what arrives is written to `prepare()`, and what is to be sent is appended to
/// `encrypted()`. OpenSSL's part, which costs most, is made when the handshake begins.
class tls_engine {
  public:
    enum class role : std::uint8_t { client, server };
    /// `ended`: the peer has said that it sends no more. After `failed`, there may be an alert to send.
    using status = transport::stream_codec::status;

    /// `shared` outlives it.
    tls_engine(const tls_context& shared, role as) noexcept : shared_(shared), role_(as) {}
    tls_engine(const tls_engine&) = delete;
    tls_engine& operator=(const tls_engine&) = delete;
    ~tls_engine();

    /// Space for bytes from the peer; not empty if the last status was `need_input`.
    std::span<char> prepare();
    void commit(std::size_t count) noexcept { end_ += count; }
    /// The peer is admitted: from now on, `prepare` may return more than 16 KiB. Strangers get no longer turns than
    /// these, so that those who send much do not delay others.
    void admit() noexcept { max_input_ = 65536; }
    /// To be sent; the owner removes what it has sent.
    [[nodiscard]] std::string& encrypted() noexcept { return encrypted_; }

    /// Begins or continues the handshake.
    status shake_hands(boost::system::error_code& why);
    /// After the handshake: the Ed25519 key that the peer has proved to have.
    [[nodiscard]] const security::public_key& peer_key() const noexcept { return peer_key_; }

    /// \pre the handshake is done
    status read(std::span<char> space, std::size_t& count, boost::system::error_code& why);
    /// Encrypts all of it. \pre the handshake is done
    void write(std::string_view text, boost::system::error_code& why);
    /// Encrypts the end of the text. Does nothing before the handshake is done.
    void finish();

    [[nodiscard]] std::size_t buffered() const noexcept;
    void shrink();

  private:
    friend struct engine_bio;

    [[nodiscard]] bool begin();
    status status_of(int result, boost::system::error_code& why);
    [[nodiscard]] bool note_peer_key();

    struct free_ssl {
        void operator()(ssl_st* ssl) const noexcept;
    };
    const tls_context& shared_;
    role role_;
    std::unique_ptr<ssl_st, free_ssl> ssl_; // null: the handshake has not begun
    security::public_key peer_key_{};
    std::unique_ptr<char[]> input_;
    std::size_t capacity_ = 0;
    std::size_t max_input_ = 16384;
    std::size_t begin_ = 0;
    std::size_t end_ = 0;
    std::string encrypted_;
    std::uint64_t read_ = 0;               // bytes of text
    std::uint64_t written_ = 0;            // records, with the current key
    std::uint64_t handshake_messages_ = 0; // since the handshake
    bool established_ = false;
    bool ended_ = false; // the peer's text
    bool failed_ = false;
    bool has_buffers_ = false; // OpenSSL's
};

} // namespace cles::tls
