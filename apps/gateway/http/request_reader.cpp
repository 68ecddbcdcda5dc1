// SPDX-License-Identifier: BSL-1.0
#include "gateway/http/request_reader.hpp"

#include <boost/asio/buffer.hpp>
#include <boost/beast/http/error.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>

#include <optional>
#include <string>
#include <utility>

namespace gateway {
namespace http = boost::beast::http;

struct request_reader::state {
    std::string buffer{};
    std::optional<http::request_parser<http::string_body>> parser{};
    http_request request{};
    bool is_head_told = false;
    std::optional<refusal> refused{};
};

namespace {

std::string std_text(boost::beast::string_view text) { return {text.data(), text.size()}; }

} // namespace

request_reader::request_reader() : state_(std::make_unique<state>()) { next(); }

request_reader::~request_reader() = default;

void request_reader::next() {
    state_->parser.emplace();
    state_->parser->header_limit(longest_head);
    state_->parser->body_limit(longest_body);
    state_->request = {};
    state_->is_head_told = false;
}

void request_reader::add(std::string_view bytes) { state_->buffer.append(bytes); }

request_reader::step request_reader::refuse(int status, const char* message) {
    state_->refused = refusal{.status = status, .message = message};
    return step::refused;
}

request_reader::step request_reader::advance() {
    auto& s = *state_;
    for (;;) {
        if (s.refused) {
            return step::refused;
        }
        if (s.parser->is_header_done() && !std::exchange(s.is_head_told, true)) {
            return take_head() ? step::head : step::refused;
        }
        if (s.parser->is_done()) {
            s.request.body = std::move(s.parser->get().body());
            return step::complete;
        }
        if (s.buffer.empty()) {
            return step::incomplete;
        }
        boost::system::error_code code;
        const auto taken = s.parser->put(boost::asio::const_buffer{s.buffer.data(), s.buffer.size()}, code);
        s.buffer.erase(0, taken);
        if (code == http::error::need_more) {
            return step::incomplete;
        }
        if (code == http::error::header_limit) {
            return refuse(431, "the head of the request is longer than 16 KiB");
        }
        if (code == http::error::body_limit) {
            return refuse(413, "the body is longer than 1 MiB");
        }
        if (code == http::error::bad_version) {
            return refuse(505, "the request is not of HTTP/1.0 or HTTP/1.1");
        }
        if (code) {
            return refuse(400, "the request is not valid HTTP");
        }
        if (taken == 0 && !s.parser->is_header_done()) {
            return step::incomplete;
        }
    }
}

bool request_reader::take_head() {
    auto& s = *state_;
    const auto& read = s.parser->get();
    s.request.method = std_text(read.method_string());
    s.request.target = std_text(read.target());
    s.request.keep_alive = s.parser->keep_alive();
    for (const auto& each : read) {
        if (s.request.fields.size() == most_fields) {
            refuse(431, "the request has more than 100 fields");
            return false;
        }
        s.request.fields.emplace_back(small_letters(std_text(each.name_string())), std_text(each.value()));
    }
    const auto length = s.request.field("content-length");
    if (s.request.count("transfer-encoding") != 0) {
        refuse(411, "Transfer-Encoding is not accepted: state the Content-Length");
    } else if (s.request.count("content-length") > 1 || length.find(',') != std::string_view::npos) {
        refuse(400, "the request has several lengths");
    } else if (s.request.count("host") != 1) {
        refuse(400, "the request has to have one Host");
    } else if (!s.request.target.starts_with('/')) {
        refuse(400, "the target of the request is not a path");
    }
    return !s.refused;
}

http_request& request_reader::request() noexcept { return state_->request; }

const refusal& request_reader::why() const noexcept { return *state_->refused; }

std::size_t request_reader::unread() const noexcept { return state_->buffer.size(); }

bool request_reader::has_begun() const noexcept { return !state_->buffer.empty() || state_->parser->got_some(); }

bool request_reader::expects_continue() const noexcept {
    return !state_->parser->is_done() && small_letters(state_->request.field("expect")) == "100-continue";
}

} // namespace gateway
