// SPDX-License-Identifier: BSL-1.0
#include "protocol/update_head.hpp"

#include "json/characters.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace cles::protocol {
namespace {

constexpr std::size_t longest = 256;
constexpr std::size_t after_size = std::string_view{" epoch=5f3a09c1 "}.size();

bool may_be_json(std::string_view body) noexcept {
    return body.size() >= 2 &&
           ((body.front() == '{' && body.back() == '}') || (body.front() == '[' && body.back() == ']'));
}

} // namespace

void update_head::remember(std::string_view line, const request_line& update) {
    forget();
    const auto head = line.substr(0, line.size() - update.body.size());
    const auto number = head.find(" seq=");
    if (!update.is_update() || head.size() > longest || number == std::string_view::npos ||
        std::count(head.begin(), head.begin() + static_cast<std::ptrdiff_t>(number), ' ') != 1) {
        return;
    }
    const auto start = number + 5;
    auto end = start;
    while (end < head.size() && json_detail::is_digit(head[end])) {
        ++end;
    }
    const auto rest = head.substr(end);
    if (rest.size() != after_size || !rest.starts_with(" epoch=") || rest.back() != ' ') {
        return;
    }
    text_ = head;
    update_ = std::make_unique<request_line>();
    malformed_request ignored;
    if (parse_request(text_, *update_, ignored)) {
        before_ = head.substr(0, start);
        after_ = rest;
    }
}

const request_line* update_head::recognise(std::string_view line) noexcept {
    if (before_.empty() || !line.starts_with(before_)) {
        return nullptr;
    }
    const auto whole = line;
    line.remove_prefix(before_.size());
    constexpr std::size_t max_digits = 18; // longer ones are left to the parser
    std::uint64_t seq = 0;
    std::size_t digits = 0;
    while (digits < line.size() && digits <= max_digits && json_detail::is_digit(line[digits])) {
        seq = seq * 10 + static_cast<std::uint64_t>(line[digits] - '0');
        ++digits;
    }
    if (digits == 0 || digits > max_digits || line[0] == '0' || !line.substr(digits).starts_with(after_)) {
        return nullptr;
    }
    line.remove_prefix(digits + after_.size());
    if (!may_be_json(line)) {
        return nullptr;
    }
    update_->seq = seq;
    update_->body = line;
    update_->text = whole;
    return update_.get();
}

} // namespace cles::protocol
