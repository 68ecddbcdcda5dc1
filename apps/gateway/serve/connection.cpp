// SPDX-License-Identifier: BSL-1.0
#include "gateway/serve/connection.hpp"

#include <algorithm>
#include <utility>

namespace gateway {
using boost::system::error_code;

connection::connection(std::unique_ptr<client_stream> stream, request_handler& handler, gateway_counts& counts,
                       const patience& limits, owner by)
    : stream_(std::move(stream)), handler_(handler), counts_(counts), limits_(limits), owner_(std::move(by)),
      timer_(stream_->socket().get_executor()) {}

void connection::start() {
    wait(limits_.handshake);
    stream_->handshake([self = shared_from_this()](error_code code, std::size_t) {
        if (code || self->phase_ == phase::closed) {
            self->close();
            return;
        }
        self->set_phase(phase::reading);
        self->wait(self->limits_.idle);
        self->read();
    });
}

void connection::close() {
    if (phase_ == phase::closed) {
        return;
    }
    set_phase(phase::closed);
    timer_.cancel();
    stream_->close();
    release();
    if (const auto served = std::exchange(exchange_, nullptr)) {
        served->cancel();
    }
    if (const auto ended = std::exchange(owner_.ended, nullptr)) {
        ended();
    }
}

void connection::set_phase(phase next) {
    // A response that its client does not read must not hold a place that others need.
    const auto is_busy = [](phase p) { return p == phase::serving || p == phase::streaming; };
    const auto before = std::exchange(phase_, next);
    if (is_busy(before) != is_busy(next) && next != phase::closed) {
        owner_.changed(is_busy(next));
    }
    if (before == phase::streaming) {
        --counts_.streams_open;
    }
}

// -- time ----------------------------------------------------------------------------------------------------------

void connection::wait(std::chrono::milliseconds limit) {
    timer_.expires_after(limit);
    timer_.async_wait([self = shared_from_this(), number = ++waits_](error_code code) {
        if (!code && number == self->waits_ && self->phase_ != phase::closed) {
            self->on_timeout();
        }
    });
}

void connection::on_timeout() {
    if (phase_ == phase::streaming && !is_writing_) {
        if (const auto served = exchange_) { // which may end the stream
            served->on_silence();
        }
        send(": \n\n"); // a comment
        return;
    }
    if (phase_ == phase::serving && !is_writing_) {
        return; // the request has a deadline of its own
    }
    const bool is_idle = phase_ == phase::reading && !reader_.has_begun();
    counts_.timeouts += is_idle || phase_ == phase::lingering ? 0U : 1U;
    on_gone();
}

// -- requests ------------------------------------------------------------------------------------------------------

void connection::read() {
    const bool is_full = phase_ != phase::reading && phase_ != phase::lingering && reader_.unread() > most_unread;
    if (is_reading_ || is_full || phase_ == phase::closed) {
        return;
    }
    is_reading_ = true;
    stream_->read(boost::asio::buffer(input_),
                  [self = shared_from_this()](error_code code, std::size_t size) { self->on_read(code, size); });
}

void connection::on_read(error_code code, std::size_t size) {
    is_reading_ = false;
    if (code && phase_ == phase::ending) { // it may read the rest nevertheless
        keeps_alive_ = false;
        return;
    }
    if (code) {
        on_gone();
        return;
    }
    if (phase_ != phase::lingering) {
        reader_.add({input_.data(), size});
    }
    if (phase_ == phase::reading) {
        advance();
    }
    read();
}

void connection::advance() {
    for (;;) {
        switch (reader_.advance()) {
        case request_reader::step::incomplete:
            if (reader_.has_begun() && !std::exchange(is_request_timed_, true)) {
                wait(limits_.request);
            }
            return;
        case request_reader::step::head:
            keeps_alive_ = reader_.request().keep_alive;
            if (const auto response = handler_.response_to_head(reader_.request())) {
                // What follows the head is not read.
                keeps_alive_ = keeps_alive_ && reader_.request().field("content-length").empty();
                set_phase(phase::serving);
                respond(*response);
                return;
            }
            if (reader_.expects_continue()) {
                put("HTTP/1.1 100 Continue\r\n\r\n");
            }
            break;
        case request_reader::step::complete: begin(); return;
        case request_reader::step::refused:
            keeps_alive_ = false;
            set_phase(phase::serving);
            respond(response_of(reader_.why()));
            return;
        }
    }
}

void connection::begin() {
    set_phase(phase::serving);
    ++waits_; // the request is here in time
    auto begun = handler_.begin(reader_.request(), shared_from_this());
    if (phase_ == phase::serving || phase_ == phase::streaming) {
        exchange_ = std::move(begun);
    }
}

void connection::next_request() {
    reader_.next();
    is_request_timed_ = false;
    set_phase(phase::reading);
    wait(limits_.idle);
    advance();
    read();
}

void connection::on_gone() {
    if (exchange_) {
        ++counts_.clients_gone;
    }
    close();
}

// -- responses -----------------------------------------------------------------------------------------------------

void connection::count(int status) {
    constexpr int class_of_client = 400;
    constexpr int class_of_server = 500;
    ++(status < class_of_client   ? counts_.responses_2xx
       : status < class_of_server ? counts_.responses_4xx
                                  : counts_.responses_5xx);
}

void connection::respond(const http_response& response) {
    if (phase_ != phase::serving) {
        return;
    }
    if (const auto size = response.body.size(); !has_room(size)) {
        const bool never = size > (token_.empty() ? most_unwritten : most_of_token);
        respond(never ? response_of({413, "the response is larger than what may wait for a client", response.fields})
                      : response_to_failure(cles::errc::busy, {}, no_room(), response.fields));
        return;
    }
    count(response.status);
    exchange_.reset();
    set_phase(phase::ending);
    const bool has_body = reader_.request().method != "HEAD";
    permanent_ = has_body ? response.permanent : std::string_view{};
    put(to_text(response, keeps_alive_, has_body));
}

// Small ones always have: otherwise clients that do not read would shut others out. Who needs no token is at this host.
bool connection::has_room(std::size_t size) const {
    const auto of_token = token_.empty() ? counts_.unwritten_of.end() : counts_.unwritten_of.find(token_);
    const bool has_share = of_token == counts_.unwritten_of.end() || of_token->second + size <= most_of_token;
    return size <= most_at_once || (has_share && counts_.unwritten + size <= most_unwritten);
}

// What a client is told for which there is none.
std::string connection::no_room() {
    std::string why = R"({"error":"busy","message":"too much waits for clients that read slowly","retry_ms":1000)";
    return why.append(reader_.request().method == "GET" ? "}" : R"(,"ran":true})");
}

void connection::begin_events(const header_fields& fields) {
    if (phase_ != phase::serving) {
        return;
    }
    count(200);
    keeps_alive_ = false;
    set_phase(phase::streaming);
    ++counts_.streams_open;
    stream_->keep_little();
    put(event_stream_head(fields));
}

void connection::send(std::string_view events) {
    if (phase_ == phase::streaming && has_room(events.size())) {
        put(events);
    } else if (phase_ == phase::streaming) {
        ++counts_.streams_cut;
        const auto served = exchange_; // until it is cancelled
        put("event: failure\ndata: " + no_room() + "\n\n");
        end_events();
        if (served) {
            served->cancel();
        }
    }
}

void connection::end_events() {
    if (phase_ != phase::streaming) {
        return;
    }
    exchange_.reset();
    set_phase(phase::ending);
    if (!is_writing_) {
        on_all_written();
    }
}

void connection::put(std::string_view text) {
    waiting_.append(text);
    hold(held_ + text.size());
    write();
}

// So much waits for the client.
void connection::hold(std::size_t size) {
    counts_.unwritten = counts_.unwritten - held_ + size;
    auto& of_token = counts_.unwritten_of[token_];
    of_token = of_token - held_ + size;
    if (of_token == 0) {
        counts_.unwritten_of.erase(token_);
    }
    held_ = size;
}

void connection::set_token(const std::string& hash) {
    const auto held = held_; // as after 100 Continue
    hold(0);
    token_ = hash;
    hold(held);
}

// All has been written, or will not be.
void connection::release() {
    hold(0);
    if (waiting_.capacity() > most_at_once) {
        waiting_ = std::string{};
    }
}

void connection::write() {
    if (is_writing_ || phase_ == phase::closed) {
        return;
    }
    if (unwritten_.empty()) {
        output_.clear();
        output_.swap(waiting_);
        unwritten_ = output_.empty() ? std::exchange(permanent_, {}) : std::string_view{output_};
    }
    if (unwritten_.empty()) {
        release();
        on_all_written();
        return;
    }
    is_writing_ = true;
    wait(limits_.writing);
    const auto size = std::min(unwritten_.size(), most_at_once);
    stream_->write(boost::asio::buffer(unwritten_.data(), size),
                   [self = shared_from_this(), size](error_code code, std::size_t) {
                       self->unwritten_.remove_prefix(size);
                       self->on_written(code);
                   });
}

void connection::on_written(error_code code) {
    is_writing_ = false;
    if (code) {
        on_gone();
    } else {
        write();
    }
}

void connection::on_all_written() {
    switch (phase_) {
    case phase::ending:
        if (keeps_alive_) {
            next_request();
            return;
        }
        set_phase(phase::lingering);
        stream_->shutdown();
        wait(limits_.lingering);
        read();
        return;
    case phase::streaming:
        wait(limits_.silence);
        if (const auto served = exchange_) {
            served->on_writable();
        }
        return;
    case phase::reading: // after 100 Continue
        wait(limits_.request);
        return;
    default: return;
    }
}

} // namespace gateway
