// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/json_writer.hpp>

#include "node/session/call.hpp"
#include "node/session/line_sink.hpp"
#include "protocol/reply_line.hpp"
#include "protocol/request_line.hpp"

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// Completes what a handler wrote from `start` on to a body: nothing becomes {}, a scalar {"value":x}.
inline void close_body(std::string& out, std::size_t start) {
    if (out.size() == start) {
        out.append("{}");
    } else if (out[start] != '{' && out[start] != '[') {
        out.insert(start, R"({"value":)");
        out.push_back('}');
    }
}

/// The same for a result. Returns why it cannot be one, or nothing: as a reply it would be read as a failure.
[[nodiscard]] std::optional<protocol::failure> close_result(std::string& out, std::size_t start);

/// Whether nodes send this request to each other on their own, for membership, task discovery and sharing: `cles`,
/// `cles/peers` and `cles/slots`. It is counted separately from the requests of programs.
inline bool is_housekeeping(const protocol::request_line& r) noexcept {
    const auto path = r.noun.path;
    return path == "cles" || path == "cles/peers" || path == "cles/slots";
}

/// The request that a reply is for, and how the reply is sent.
struct reply_target {
    std::uint64_t id = 0; ///< 0: the request had none
    bool wanted = true;
    bool urgent = false;
    bool housekeeping = false;
    bool reserved = false;  ///< for the task `cles`, which is answered even without free memory
    bool apart = false;     ///< not the reply to the request in flight with that id
    std::uint64_t span = 0; ///< of a traced request, which ends with the reply

    explicit reply_target(const call::terms& r) noexcept : reply_target(r.id, r.wants_reply, r.carried()) {}
    explicit reply_target(const protocol::request_line& r) noexcept : reply_target(r.id, r.wants_reply, r.carried()) {
        housekeeping = is_housekeeping(r);
        reserved = r.noun.task == "cles";
    }
    explicit reply_target(const protocol::malformed_request& r) noexcept : reply_target(r.id, r.wants_reply, {}) {
        apart = true;
    }

  private:
    reply_target(std::uint64_t of, bool reply_wanted, const protocol::carried_adverbs& r) noexcept
        : id(of), wanted(reply_wanted), urgent(r.urgent && of != 0), // without an id, order matters
          span(r.trace.sampled ? r.trace.span : 0) {}
};

/// Writes the replies of one link: a handler's result, or the failure that replaces it.
class reply_writer {
  public:
    reply_writer(node_state& host, line_sink& out) noexcept;

    /// Also records replies in `seen`, for requests that may be repeated.
    void remember(dedup& seen) noexcept { seen_ = &seen; }
    /// The maximum length of a line, without its LF.
    [[nodiscard]] std::size_t longest() const noexcept { return max_reply_; }
    [[nodiscard]] bool by_datagram() const noexcept { return out_.is_datagram(); }

    /// Sends a reply whose body `write` writes. If that throws, the exception passes through and nothing is sent.
    template <class F>
    void write(const protocol::request_line& r, F&& write) {
        // Assembled outside the output, since the handler may send on this link meanwhile; and in a buffer that is
        // taken from `spare_`, since the handler may cause other requests to be answered.
        auto text = std::exchange(spare_, {});
        text.clear();
        protocol::append_reply_head(text, r.id);
        const auto body = text.size();
        json_writer writer{text};
        std::forward<F>(write)(writer);
        send(reply_target{r}, text, body);
        constexpr std::size_t roomy = 65536;
        if (text.capacity() <= roomy) {
            spare_ = std::move(text);
        }
    }
    /// Sends a reply with this body; empty means {}. `head`: adverbs before it, if the request had an id.
    void done(reply_target where, std::string_view body, std::string_view head = {});
    [[gnu::cold]] void fail(reply_target where, const protocol::failure& why);
    void fail(const protocol::request_line& r, const protocol::failure& why) { fail(reply_target{r}, why); }
    void fail(const protocol::request_line& r, errc code, std::string message) {
        fail(reply_target{r}, {.code = code, .message = std::move(message)});
    }
    /// Sends an interim reply. If the line would be too long, it is sent without its details: the peer would close the
    /// link over it, or it would not fit into a datagram.
    void progress(reply_target where, double fraction, std::string_view json);

  private:
    [[nodiscard]] std::string& output_for(reply_target where) {
        return where.urgent ? out_.urgent_output() : out_.output();
    }
    void send(reply_target where, std::string& text, std::size_t body);
    void note(reply_target where, std::string_view reply, std::string_view outcome);

    node_state& node_;
    line_sink& out_;
    std::size_t max_reply_;
    dedup* seen_ = nullptr;
    std::string spare_;
};

} // namespace cles::core
