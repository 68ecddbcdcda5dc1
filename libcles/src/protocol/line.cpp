// SPDX-License-Identifier: BSL-1.0
#include "protocol/line.hpp"

#include <algorithm>
#include <cstring>

namespace cles::protocol {
namespace {

constexpr std::size_t initial_capacity = 4096;
constexpr std::size_t read_ahead = 65536; // beyond this, only a long line makes the buffer grow

} // namespace

void line_buffer::resize(std::size_t capacity) {
    auto data = std::unique_ptr<char[]>(new char[capacity]); // uninitialised on purpose
    if (end_ != begin_) {
        std::memcpy(data.get(), data_.get() + begin_, end_ - begin_);
    }
    data_ = std::move(data);
    capacity_ = capacity;
    scanned_ -= begin_;
    end_ -= begin_;
    begin_ = 0;
}

std::span<char> line_buffer::prepare() {
    const auto pending = end_ - begin_;
    if (pending == 0) {
        begin_ = scanned_ = end_ = 0;
        if (capacity_ > read_ahead) {
            resize(read_ahead);
        }
    }
    if (capacity_ == 0) {
        resize(initial_capacity);
    } else if (filled_ && capacity_ < read_ahead) {
        resize(std::min(capacity_ * 4, read_ahead));
    } else if (pending > capacity_ / 2 && capacity_ < limit_ + read_ahead) {
        resize(std::min(capacity_ * 2, limit_ + read_ahead));
    } else if (begin_ != 0 && capacity_ - end_ < capacity_ / 2) {
        std::memmove(data_.get(), data_.get() + begin_, pending);
        scanned_ -= begin_;
        end_ = pending;
        begin_ = 0;
    }
    return {data_.get() + end_, capacity_ - end_};
}

void line_buffer::shrink() {
    const auto enough = std::max(initial_capacity, (end_ - begin_) * 2);
    if (capacity_ > enough) {
        resize(enough);
        filled_ = false;
    }
}

void line_buffer::commit(std::size_t count) noexcept {
    end_ += count;
    filled_ = end_ == capacity_;
}

line_buffer::status line_buffer::next(std::string_view& line) noexcept {
    const auto* found = end_ == scanned_
                            ? nullptr
                            : static_cast<const char*>(std::memchr(data_.get() + scanned_, '\n', end_ - scanned_));
    const auto line_end = found != nullptr ? static_cast<std::size_t>(found - data_.get()) : end_;
    line = {data_.get() + begin_, line_end - begin_};
    if (line.size() - (line.ends_with('\r') ? 1 : 0) > limit_) { // a CR before the LF is dropped
        line = line.substr(0, limit_);
        return status::overlong;
    }
    scanned_ = line_end;
    if (found == nullptr) {
        return status::need_more;
    }
    begin_ = scanned_ = line_end + 1;
    return status::line;
}

std::string_view trim(std::string_view line) noexcept {
    if (!line.empty() && line.back() == '\r') {
        line.remove_suffix(1);
    }
    while (!line.empty() && line.back() == ' ') {
        line.remove_suffix(1);
    }
    while (!line.empty() && line.front() == ' ') {
        line.remove_prefix(1);
    }
    return line;
}

bool is_http(std::string_view line) noexcept {
    constexpr std::string_view host = "host:";
    if (line.ends_with(" HTTP/1.0") || line.ends_with(" HTTP/1.1")) {
        return true;
    }
    const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
    return std::ranges::equal(line.substr(0, host.size()), host, {}, lower);
}

} // namespace cles::protocol
