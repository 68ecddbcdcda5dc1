// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>

#include "core/node.hpp"
#include "core/outlet.hpp"
#include "core/result_text.hpp"
#include "protocol/message.hpp"

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// Writes the replies of one link: a handler's result, or the error that it has to become.
class reply_writer {
  public:
    reply_writer(node& host, outlet& out) noexcept;

    /// Has replies written down there too, for requests that may be repeated.
    void remember(dedup& seen) noexcept { seen_ = &seen; }
    /// What a line that is sent may have, without its LF.
    [[nodiscard]] std::size_t longest() const noexcept { return longest_; }

    /// A reply whose body `write` writes. What it throws passes through, and nothing is sent.
    template <class F>
    void write(const protocol::request_line& r, F&& write) {
        // Put together apart from the output, so that what the handler sends on this link meanwhile does not get into
        // it; and in a buffer that is taken away meanwhile, since the handler may answer other requests too.
        auto text = std::exchange(spare_, {});
        text.clear();
        protocol::append_reply_head(text, r.id);
        const auto body = text.size();
        json_writer writer{text};
        std::forward<F>(write)(writer);
        send(r.id, r.wants_reply, text, body);
        constexpr std::size_t roomy = 65536;
        if (text.capacity() <= roomy) {
            spare_ = std::move(text);
        }
    }
    /// A reply with this body; empty for {}.
    void done(std::uint64_t id, bool wanted, std::string_view body);
    void fail(std::uint64_t id, bool wanted, const protocol::failure& why);
    /// The same, where it is not the reply to the request of that id which is in flight.
    void fail_apart(std::uint64_t id, bool wanted, const protocol::failure& why);
    void fail(const protocol::request_line& r, const protocol::failure& why) { fail(r.id, r.wants_reply, why); }
    void fail(const protocol::request_line& r, errc code, std::string message) {
        fail(r.id, r.wants_reply, {.code = code, .message = std::move(message)});
    }

  private:
    void send(std::uint64_t id, bool wanted, std::string& text, std::size_t body);
    void note(std::uint64_t id, std::string_view reply);

    node& node_;
    outlet& out_;
    std::size_t longest_;
    dedup* seen_ = nullptr;
    std::string spare_;
};

} // namespace cles::core
