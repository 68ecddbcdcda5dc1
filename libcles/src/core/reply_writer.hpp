// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>

#include "core/housekeeping.hpp"
#include "core/node.hpp"
#include "core/outlet.hpp"
#include "core/result_text.hpp"
#include "protocol/message.hpp"

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// Which request a reply is for, and how it is sent.
struct reply_to {
    std::uint64_t id = 0; ///< 0: the request had none
    bool wanted = true;
    bool urgent = false;
    bool housekeeping = false;
    bool reserved = false; ///< of the task `cles`, which is answered however little memory is left

    reply_to(std::uint64_t of, bool reply_wanted, bool is_urgent = false) noexcept
        : id(of), wanted(reply_wanted), urgent(is_urgent && of != 0) {} // without an id the order counts
    explicit reply_to(const protocol::request_line& r) noexcept : reply_to(r.id, r.wants_reply, r.urgent) {
        housekeeping = is_housekeeping(r);
        reserved = r.noun.task == "cles";
    }
};

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
        send(reply_to{r}, text, body);
        constexpr std::size_t roomy = 65536;
        if (text.capacity() <= roomy) {
            spare_ = std::move(text);
        }
    }
    /// A reply with this body; empty for {}. Where the request had an id, `head` are adverbs that stand before it.
    void done(reply_to where, std::string_view body, std::string_view head = {});
    void fail(reply_to where, const protocol::failure& why);
    /// The same, where it is not the reply to the request of that id which is in flight.
    void fail_apart(reply_to where, const protocol::failure& why);
    void fail(const protocol::request_line& r, const protocol::failure& why) { fail(reply_to{r}, why); }
    void fail(const protocol::request_line& r, errc code, std::string message) {
        fail(reply_to{r}, {.code = code, .message = std::move(message)});
    }

  private:
    [[nodiscard]] std::string& output_for(reply_to where) {
        return where.urgent ? out_.urgent_output() : out_.output();
    }
    void send(reply_to where, std::string& text, std::size_t body);
    void note(std::uint64_t id, std::string_view reply);

    node& node_;
    outlet& out_;
    std::size_t longest_;
    dedup* seen_ = nullptr;
    std::string spare_;
};

} // namespace cles::core
