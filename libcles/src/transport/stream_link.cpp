// SPDX-License-Identifier: BSL-1.0
#include "transport/stream_link.hpp"

#include "transport/member_handler.hpp"
#include "transport/transports.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/asio/error.hpp>

#include <algorithm>
#include <utility>

#include <poll.h>

namespace cles::transport {
namespace asio = boost::asio;
using boost::system::error_code;

namespace {

constexpr std::size_t bytes_per_turn = 65536; // of what is written in reply
constexpr std::size_t piece = 65536;          // sent as one, before urgent output may pass
constexpr std::size_t roomy = 262144;         // larger buffers are released

// Assigning an empty string would keep the memory.
void release(std::string& text) noexcept { std::string{}.swap(text); }

} // namespace

stream_link::stream_link(socket_type socket, identity peer, const limits& bounds, std::unique_ptr<stream_codec> codec)
    : socket_(std::move(socket)), peer_(std::move(peer)), bounds_(bounds), codec_(std::move(codec)),
      input_(bounds.line), timeout_(socket_.get_executor()), opening_(codec_ != nullptr) {
    error_code ignored;
    socket_.non_blocking(true, ignored);
}

void stream_link::start(std::shared_ptr<link_events> owner) {
    owner_ = std::move(owner);
    if (!codec_) {
        read();
    } else if (state_ == state::closed) { // it could not be opened
        post_call<&stream_link::report_failure>(socket_.get_executor(), shared_from_this());
    } else if (!opening_) {
        continue_later(); // the codec may have text already
    }
}

// -- opening, with a codec -----------------------------------------------------------------------------------------

void stream_link::open(std::function<void(error_code)> opened) {
    opened_ = std::move(opened);
    codec_->watch([weak = weak_from_this()](error_code why) {
        if (const auto self = weak.lock()) {
            post_call<&stream_link::fail>(self->socket_.get_executor(), self, why);
        }
    });
    timeout_.expires_after(codec_->time_to_open());
    wait_call<&stream_link::on_opening_timeout>(timeout_, shared_from_this());
    post_call<&stream_link::continue_opening>(socket_.get_executor(), shared_from_this());
}

void stream_link::on_opening_timeout(error_code code) {
    if (!code && opening_ && state_ == state::open) {
        failure_ = asio::error::timed_out;
        finish();
    }
}

void stream_link::report_failure() {
    if (const auto told = std::exchange(owner_, nullptr)) {
        told->on_lost(failure_);
    }
}

void stream_link::continue_opening() {
    if (state_ != state::open) {
        return;
    }
    const auto status = codec_->open(failure_);
    flush();
    if (status == stream_codec::status::done) {
        on_opened();
    } else if (status == stream_codec::status::need_input && !stream_ended_) {
        read();
    } else {
        if (!failure_) {
            failure_ = asio::error::connection_reset;
        }
        finish(); // the codec explains it to the peer
    }
}

void stream_link::on_opened() {
    opening_ = false;
    timeout_.cancel();
    codec_->describe(peer_);
    flush();
    if (owner_) {
        continue_later();
    }
    if (const auto opened = std::exchange(opened_, nullptr)) {
        opened({});
    }
}

// The codec may have an explanation for the peer, but the link ends now.
void stream_link::fail(error_code why) {
    if (state_ != state::closed) {
        const auto self = shared_from_this();
        flush();
        lose(why);
    }
}

// -- reading -------------------------------------------------------------------------------------------------------

void stream_link::read() {
    if (reading_ || ended_ || stream_ended_ || overlong_ || state_ == state::closed) {
        return;
    }
    reading_ = true;
    const auto space = codec_ ? codec_->prepare() : input_.prepare();
    read_into(asio::buffer(space.data(), space.size()));
}

void stream_link::read_into(asio::mutable_buffer space) {
    socket_.async_receive(
        space, [self = shared_from_this()](error_code code, std::size_t count) { self->on_read(code, count); });
}

void stream_link::on_read(error_code code, std::size_t count) {
    reading_ = false;
    if (state_ == state::closed) {
        return;
    }
    if (!codec_) {
        received_ += count;
    }
    if (std::exchange(shrinking_, false) && code == asio::error::operation_aborted) {
        if (state_ == state::open) {
            release_input();
            read();
        } else {
            discard();
        }
        return;
    }
    if (state_ == state::discarding || state_ == state::finishing) {
        if (code) {
            ended_ = true;
            if (state_ == state::discarding) {
                lose(code);
            }
        } else {
            discard();
        }
        return;
    }
    if (code) { // usually not, and comparing takes longer
        if (code != asio::error::eof) {
            lose(code);
            return;
        }
        (codec_ ? stream_ended_ : ended_) = true;
    }
    if (!codec_) {
        input_.commit(count);
        hand_over();
        return;
    }
    codec_->commit(count);
    if (opening_) {
        continue_opening();
    } else {
        hand_over();
    }
}

// More input for lines, of what the codec has received. Returns false if there is none.
bool stream_link::decode() {
    const auto space = input_.prepare();
    std::size_t count = 0;
    const auto status = codec_->decode(space, count, failure_);
    if (!codec_->encoded().empty()) {
        flush();
    }
    switch (status) {
    case stream_codec::status::done:
        received_ += count;
        input_.commit(count);
        return true;
    case stream_codec::status::ended: ended_ = true; break;
    case stream_codec::status::need_input:
        if (stream_ended_) { // anybody could have ended it
            failure_ = asio::error::connection_reset;
        }
        break;
    case stream_codec::status::failed: break;
    }
    return false;
}

void stream_link::hand_over() {
    if (handing_ || overlong_ || state_ != state::open || !owner_) {
        return;
    }
    const auto self = shared_from_this();
    handing_ = true;
    bool more = true;
    try {
        more = hand_over_batch();
    } catch (...) { // of a handler, for the thread that runs the context; the other lines are not affected
        handing_ = false;
        continue_later();
        throw;
    }
    handing_ = false;
    if (codec_ && failure_) {
        fail(failure_);
    } else if (state_ == state::finishing || state_ == state::discarding) {
        discard();
    } else if (state_ == state::open && !paused_) {
        if (more) {
            continue_later();
        } else {
            read();
        }
    }
}

// Returns true if lines may be left.
bool stream_link::hand_over_batch() {
    const auto owner = owner_;
    int turn = lines_per_turn;
    const auto enough = written() + bytes_per_turn;
    bool more = true;
    while (more && turn-- > 0 && written() < enough && !paused_ && state_ == state::open) {
        std::string_view line;
        switch (input_.next(line)) {
        case protocol::line_buffer::status::line: owner->on_line(line); break;
        case protocol::line_buffer::status::overlong:
            overlong_ = true;
            more = false;
            owner->on_overlong(line);
            break;
        case protocol::line_buffer::status::need_more: more = codec_ && decode(); break;
        }
    }
    if (state_ == state::open && !more && ended_ && !end_reported_ && !overlong_) {
        end_reported_ = true;
        if (const auto rest = input_.unfinished(); !rest.empty()) {
            owner->on_cut(rest);
        }
        if (state_ == state::open) {
            owner->on_end();
        }
        if (state_ == state::open) {
            watch_for_hangup();
        }
    }
    if (state_ != state::closed) {
        owner->on_batch();
    }
    return more;
}

// Lines are left, but other links are served first.
void stream_link::continue_later() {
    if (!posted_) {
        posted_ = true;
        post_call<&stream_link::go_on>(socket_.get_executor(), shared_from_this());
    }
}

void stream_link::go_on() {
    posted_ = false;
    if (state_ == state::open) {
        hand_over();
    } else {
        discard();
    }
}

void stream_link::pause(bool stop) {
    if (paused_ != stop) {
        paused_ = stop;
        if (!stop && !handing_ && state_ == state::open && !reading_) {
            continue_later();
        }
    }
}

// -- writing -------------------------------------------------------------------------------------------------------

void stream_link::flush() {
    if (state_ == state::closed || state_ == state::discarding || waiting_) {
        return;
    }
    if (codec_) {
        flush_encoded();
        return;
    }
    put_urgent_first();
    if (output_.empty()) {
        return;
    }
    error_code code;
    const auto count = socket_.send(asio::buffer(output_), 0, code);
    if (code && code != asio::error::would_block) {
        lose_later(code);
        return;
    }
    sent_ += count;
    if (count == output_.size()) {
        clear_output();
        return;
    }
    waiting_ = true;
    sending_.swap(output_);
    sending_at_ = count;
    write_rest();
}

void stream_link::put_urgent_first() {
    if (!urgent_.empty()) {
        output_.insert(0, urgent_);
        if (urgent_.capacity() > roomy) {
            release(urgent_);
        }
        urgent_.clear();
    }
}

void stream_link::clear_output() {
    if (output_.capacity() > roomy) {
        release(output_);
    }
    output_.clear();
}

// Reported later: the owner may be in the middle of something, and may read the explanation before that.
void stream_link::lose_later(error_code why) {
    post_call<&stream_link::lose>(socket_.get_executor(), shared_from_this(), why);
    output_.clear();
}

// Until the codec is open, the output stays, and only what the codec says itself is sent.
void stream_link::flush_encoded() {
    if (!opening_) {
        put_urgent_first();
    }
    error_code code;
    const auto count = send_encoded(code);
    if (code && code != asio::error::would_block) {
        lose_later(code);
        return;
    }
    sent_ += count;
    waiting_ = !encoded_.empty();
    if (waiting_) {
        if (!opening_) {
            sending_.swap(output_);
            sending_at_ = count;
        }
        write_rest();
    } else if (!opening_) {
        clear_output();
    }
}

// Encodes the output and sends it, in pieces. Returns the size of what was sent; the rest of the last piece is left in
// `encoded_`.
std::size_t stream_link::send_encoded(error_code& code) {
    auto& bytes = codec_->encoded();
    std::size_t done = 0;
    for (;;) {
        if (!bytes.empty()) {
            const auto count = socket_.send(asio::buffer(bytes), 0, code);
            if (count < bytes.size()) {
                encoded_.swap(bytes);
                encoded_at_ = count;
                return done;
            }
            bytes.clear();
            done += std::exchange(encoding_, 0);
        }
        if (opening_ || done == output_.size()) {
            return done;
        }
        encoding_ = std::min(piece, output_.size() - done);
        codec_->encode(std::string_view{output_}.substr(done, encoding_), code);
        if (code) {
            return done;
        }
    }
}

// Up to the end of a line, where urgent output may pass: of the current line, if such output is pending already.
void stream_link::write_rest() {
    if (encoded_at_ < encoded_.size()) {
        async_send(std::string_view{encoded_}.substr(encoded_at_));
        return;
    }
    const auto line = sending_.find('\n', sending_at_ + (urgent_.empty() ? piece : 0));
    const auto end = line == std::string::npos ? sending_.size() : line + 1;
    const auto text = std::string_view{sending_}.substr(sending_at_, end - sending_at_);
    if (!codec_) {
        async_send(text);
        return;
    }
    if (codec_->encoded().empty()) {
        error_code code;
        codec_->encode(text, code);
        if (code) {
            lose_later(code);
            return;
        }
        encoding_ = text.size();
    }
    encoded_.swap(codec_->encoded());
    async_send(encoded_);
}

void stream_link::async_send(std::string_view bytes) {
    socket_.async_send(
        asio::buffer(bytes.data(), bytes.size()),
        [self = shared_from_this()](error_code code, std::size_t count) { self->on_written(code, count); });
}

void stream_link::let_urgent_pass() {
    if (!urgent_.empty() && !opening_ && (sending_at_ == 0 || sending_[sending_at_ - 1] == '\n')) {
        sending_.insert(sending_at_, urgent_);
        urgent_.clear();
    }
}

void stream_link::on_written(error_code code, std::size_t count) {
    if (state_ == state::closed) {
        return;
    }
    if (code) {
        lose(code);
        return;
    }
    if (codec_) {
        encoded_at_ += count;
        if (encoded_at_ < encoded_.size()) {
            write_rest();
            return;
        }
        if (encoded_.capacity() > roomy) {
            release(encoded_);
        }
        encoded_.clear();
        encoded_at_ = 0;
        count = std::exchange(encoding_, 0);
    }
    sent_ += count;
    sending_at_ += count;
    if (sending_at_ < sending_.size() || (codec_ && !codec_->encoded().empty())) {
        let_urgent_pass();
        write_rest();
        return;
    }
    if (sending_.capacity() > roomy) {
        release(sending_);
    }
    sending_.clear();
    sending_at_ = 0;
    waiting_ = false;
    flush();
    if (waiting_) {
        return;
    }
    if (state_ == state::finishing) {
        shut_down_output();
    } else if (const auto owner = owner_) {
        owner->on_writable();
    }
}

// -- memory --------------------------------------------------------------------------------------------------------

// The pending read holds the input's buffer; it is restarted with a smaller one.
void stream_link::shrink() {
    if (state_ != state::open || waiting_ || handing_ || opening_) {
        return;
    }
    release(sending_);
    release(encoded_);
    if (output_.empty()) {
        release(output_);
    }
    if (urgent_.empty()) {
        release(urgent_);
    }
    if (!reading_) {
        release_input();
    } else if (!shrinking_) {
        shrinking_ = true;
        error_code ignored;
        socket_.cancel(ignored);
    }
}

void stream_link::release_input() {
    if (!codec_ || !input_.unfinished().empty()) {
        input_.shrink();
    } else { // the codec has space to read into
        input_ = protocol::line_buffer{bounds_.line};
    }
    if (codec_) {
        codec_->shrink();
    }
}

// -- ending --------------------------------------------------------------------------------------------------------

void stream_link::watch_for_hangup() {
    wait_call<&stream_link::on_error_condition>(socket_, socket_type::wait_error, shared_from_this());
}

// It may be urgent data, which means nothing here. The condition persists, so this stops waiting; a write shows further
// errors.
void stream_link::on_error_condition(error_code code) {
    if (code || state_ == state::closed) {
        return;
    }
    pollfd now{.fd = socket_.native_handle(), .events = 0, .revents = 0};
    if (::poll(&now, 1, 0) > 0 && (now.revents & (POLLERR | POLLHUP)) != 0) {
        lose(asio::error::connection_reset);
    }
}

void stream_link::finish() {
    if (state_ != state::open) {
        return;
    }
    flush();
    state_ = state::finishing;
    if (!waiting_) {
        shut_down_output();
    } else if (!handing_) {
        discard();
    }
}

void stream_link::shut_down_output() {
    if (codec_ && !std::exchange(finished_, true)) {
        codec_->finish();
        flush();
        if (waiting_) { // this continues when the socket has taken it
            if (!handing_) {
                discard();
            }
            return;
        }
    }
    state_ = state::discarding;
    error_code ignored;
    socket_.shutdown(asio::socket_base::shutdown_send, ignored);
    timeout_.expires_after(bounds_.discard);
    wait_call<&stream_link::on_discard_timeout>(timeout_, shared_from_this());
    if (ended_) {
        post_call<&stream_link::lose>(socket_.get_executor(), shared_from_this(), asio::error::eof);
    } else if (!handing_) {
        discard();
    }
}

void stream_link::on_discard_timeout(error_code code) {
    if (!code) {
        lose(asio::error::eof);
    }
}

// Reads and discards, so that closing does not reset a connection whose last replies are still in transit.
void stream_link::discard() {
    if (reading_ || ended_ || state_ == state::closed) {
        return;
    }
    reading_ = true;
    discarded_.resize(4096);
    read_into(asio::buffer(discarded_));
}

void stream_link::lose(error_code why) {
    if (state_ == state::closed) {
        return;
    }
    if (!failure_) {
        failure_ = why;
    }
    const auto owner = owner_;
    const auto opened = opened_;
    close();
    if (owner) {
        owner->on_lost(failure_);
    }
    if (opened) {
        opened(failure_);
    }
}

void stream_link::close() {
    owner_.reset();
    opened_ = nullptr;
    if (state_ == state::closed) {
        return;
    }
    state_ = state::closed;
    error_code ignored;
    timeout_.cancel();
    socket_.close(ignored);
}

} // namespace cles::transport
