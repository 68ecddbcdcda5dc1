// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include "protocol/line.hpp"
#include "transport/stream_codec.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/generic/stream_protocol.hpp>
#include <boost/asio/steady_timer.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace cles::transport {

/// A link over a stream socket of any family.
///
/// One read delivers many lines and one write carries many replies. Output is written at once, without waiting for the
/// reactor; only what the socket does not take waits for it. After a bounded number of lines, other links are served.
/// In steady state neither allocates. After the peer's end of stream, it watches for a reset and for the hang-up of a
/// Unix socket, which no read would show any more.
///
/// With a codec, the link is first opened, with or without an owner; until then it delivers no lines, and keeps output.
class stream_link final : public link, public std::enable_shared_from_this<stream_link> {
  public:
    using socket_type = boost::asio::generic::stream_protocol::socket;

    [[gnu::cold]] stream_link(socket_type socket, identity peer, const limits& bounds,
                              std::unique_ptr<stream_codec> codec = nullptr);

    /// Opens a link that has a codec. `opened` is called when it is open or has failed, unless it is closed before, and
    /// never from inside this call.
    [[gnu::cold]] void open(std::function<void(boost::system::error_code)> opened = nullptr);
    void start(std::shared_ptr<link_events> owner) override;
    std::string& output() override { return output_; }
    std::string& urgent_output() override { return urgent_; }
    void flush() override;
    [[nodiscard]] std::size_t unsent() const noexcept override {
        return urgent_.size() + output_.size() + sending_.size() - sending_at_;
    }
    [[nodiscard]] std::uint64_t sent() const noexcept override { return sent_; }
    [[nodiscard]] std::uint64_t received() const noexcept override { return received_; }
    void pause(bool stop) override;
    [[gnu::cold]] void finish() override;
    [[gnu::cold]] void close() override;
    [[nodiscard]] std::size_t buffered() const noexcept override {
        return input_.capacity() + output_.capacity() + urgent_.capacity() + sending_.capacity() +
               (codec_ ? encoded_.capacity() + codec_->buffered() : 0);
    }
    [[gnu::cold]] void shrink() override;
    [[nodiscard]] const identity& peer() const noexcept override { return peer_; }
    [[nodiscard]] std::string_view epoch() const noexcept override {
        return codec_ && !opening_ ? codec_->epoch() : std::string_view{};
    }

  private:
    enum class state : std::uint8_t { open, finishing, discarding, closed };

    void read();
    void read_into(boost::asio::mutable_buffer space);
    void on_read(boost::system::error_code code, std::size_t count);
    void hand_over();
    bool hand_over_batch();
    [[nodiscard]] std::uint64_t written() const noexcept { return sent_ + unsent(); }
    void continue_later();
    void go_on();
    [[nodiscard]] bool decode();
    [[gnu::cold]] void release_input();
    void put_urgent_first();
    void clear_output();
    [[gnu::cold]] void lose_later(boost::system::error_code why);
    void flush_encoded();
    [[nodiscard]] std::size_t send_encoded(boost::system::error_code& code);
    void write_rest();
    void async_send(std::string_view bytes);
    void let_urgent_pass();
    void on_written(boost::system::error_code code, std::size_t count);
    [[gnu::cold]] void shut_down_output();
    [[gnu::cold]] void discard();
    [[gnu::cold]] void watch_for_hangup();
    [[gnu::cold]] void on_error_condition(boost::system::error_code code);
    [[gnu::cold]] void on_discard_timeout(boost::system::error_code code);
    [[gnu::cold]] void lose(boost::system::error_code why);
    // With a codec:
    [[gnu::cold]] void report_failure();
    [[gnu::cold]] void on_opening_timeout(boost::system::error_code code);
    [[gnu::cold]] void continue_opening();
    [[gnu::cold]] void on_opened();
    [[gnu::cold]] void fail(boost::system::error_code why);

    socket_type socket_;
    identity peer_;
    limits bounds_;
    std::unique_ptr<stream_codec> codec_; // null: lines are sent as they are
    std::function<void(boost::system::error_code)> opened_;
    boost::system::error_code failure_; // why it is lost
    std::shared_ptr<link_events> owner_;
    protocol::line_buffer input_;
    std::string output_;
    std::string urgent_;    // sent before it
    std::string sending_;   // what the socket did not take at once
    std::string discarded_; // buffer for input that is discarded
    std::size_t sending_at_ = 0;
    std::string encoded_; // what the socket did not take at once, encoded
    std::size_t encoded_at_ = 0;
    std::size_t encoding_ = 0; // bytes of text in it
    boost::asio::steady_timer timeout_;
    std::uint64_t sent_ = 0;
    std::uint64_t received_ = 0;
    state state_ = state::open;
    bool opening_ = false;   // by the codec
    bool waiting_ = false;   // for the socket to take output
    bool reading_ = false;   // a read is pending
    bool shrinking_ = false; // and was cancelled, to continue with a smaller buffer
    bool handing_ = false;   // lines are being delivered, further up the stack
    bool posted_ = false;    // `hand_over` will continue
    bool paused_ = false;
    bool ended_ = false;        // the peer sends no more
    bool stream_ended_ = false; // the socket's stream has ended, with a codec
    bool finished_ = false;     // the codec's output is complete
    bool end_reported_ = false;
    bool overlong_ = false;
};

} // namespace cles::transport
