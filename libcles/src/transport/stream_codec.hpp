// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/identity.hpp>

#include <boost/system/error_code.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace cles::transport {

/// What a stream link puts between the bytes of its socket and its lines: encryption, and what both ends have to prove
/// before the link is used. Sans-I/O.
///
/// Bytes from the socket are written to `prepare()` and announced by `commit`; any call may append bytes for it to
/// `encoded()`. First, `open` is called until the codec is open. From then on, `decode` returns the peer's text, and
/// `encode` takes this end's.
class stream_codec {
  public:
    enum class status : std::uint8_t {
        done,       ///< it is open; some text was decoded
        need_input, ///< more bytes have to be received first
        ended,      ///< the peer has ended its text
        failed,     ///< the stream is of no use any more
    };

    stream_codec() = default;
    stream_codec(const stream_codec&) = delete;
    stream_codec& operator=(const stream_codec&) = delete;
    virtual ~stream_codec() = default;

    /// Space for received bytes; never empty while `decode` and `open` need input.
    virtual std::span<char> prepare() = 0;
    virtual void commit(std::size_t count) = 0;

    /// Continues to open the stream. `why` is set if it failed.
    virtual status open(boost::system::error_code& why) = 0;
    /// The time within which it must be open.
    [[nodiscard]] virtual std::chrono::milliseconds time_to_open() const = 0;
    /// After it has opened: adds what it has found out about the peer.
    virtual void describe(identity& peer) const = 0;
    /// After it has opened: the epoch that the peer has stated; empty if it states none.
    [[nodiscard]] virtual std::string_view epoch() const noexcept = 0;
    /// Before it opens: `broken` is called when something else than the stream's bytes ends it, such as the peer's loss
    /// of the right to use it. From then on, nothing is decoded or encoded.
    virtual void watch(std::function<void(boost::system::error_code)> broken) = 0;

    /// Decodes at most `space.size()` bytes; `count` is set with `done`, and `why` with `failed`.
    virtual status decode(std::span<char> space, std::size_t& count, boost::system::error_code& why) = 0;
    /// Encodes all of `text`.
    virtual void encode(std::string_view text, boost::system::error_code& why) = 0;
    /// Encodes the end of this end's text. No text follows.
    virtual void finish() = 0;

    /// Bytes to send, which the link removes.
    [[nodiscard]] virtual std::string& encoded() noexcept = 0;

    /// Bytes of memory that it holds for reading and writing.
    [[nodiscard]] virtual std::size_t buffered() const noexcept = 0;
    /// Frees unused memory. Invalidates prepared space.
    virtual void shrink() = 0;
};

/// Makes the codec of a connection; empty for links without one.
using codec_maker = std::function<std::unique_ptr<stream_codec>(const identity& peer)>;

} // namespace cles::transport
