// SPDX-License-Identifier: BSL-1.0
#include "core/reply_writer.hpp"

namespace cles::core {
namespace {

constexpr std::size_t longest_escape = 6; // "\u0000"
constexpr std::size_t head_room = 24;     // times as much is enough for all that stands around a failure's message

// Shortens text, but not inside a character.
void cut(std::string& text, std::size_t longest) {
    if (text.size() > longest) {
        while (longest != 0 && (static_cast<unsigned char>(text[longest]) & 0xC0U) == 0x80U) {
            --longest;
        }
        text.resize(longest);
    }
}

} // namespace

void reply_writer::done(std::uint64_t id, bool wanted, std::string_view body) {
    std::string text;
    protocol::append_reply_head(text, id);
    const auto at = text.size();
    text.append(body);
    send(id, wanted, text, at);
}

void reply_writer::send(std::uint64_t id, bool wanted, std::string& text, std::size_t body) {
    close_result(text, body);
    if (protocol::begins_with_error(std::string_view{text}.substr(body))) {
        fail(id, wanted, {.code = errc::failed, .message = node_.name + ": the result's first key is 'error'"});
    } else if (text.size() > node_.bounds.line) {
        fail(id, wanted,
             {.code = errc::too_large,
              .message = node_.name + ": the answer has " + std::to_string(text.size()) + " bytes, the limit is " +
                         std::to_string(node_.bounds.line),
              .ran = true});
    } else if (wanted) {
        text.push_back('\n');
        out_.output().append(text);
    }
}

void reply_writer::fail(std::uint64_t id, bool wanted, const protocol::failure& why) {
    if (!wanted) {
        ++node_.counts.errors_unsent;
        return;
    }
    ++node_.counts.errors;
    auto told = why;
    if (!told.message.starts_with(node_.name)) { // a handler's own words do not say whose they are
        told.message.insert(0, node_.name + ": ");
    }
    auto& out = out_.output();
    const auto line = out.size();
    protocol::append_reply_head(out, id);
    const auto body = out.size();
    protocol::append_failure(out, told);
    if (out.size() - line >
        node_.bounds.line) { // a handler may have many words; the peer would close the link over them
        out.resize(body);
        cut(told.message,
            node_.bounds.line / longest_escape > head_room ? node_.bounds.line / longest_escape - head_room : 0);
        protocol::append_failure(out, told);
    }
    out.push_back('\n');
}

} // namespace cles::core
