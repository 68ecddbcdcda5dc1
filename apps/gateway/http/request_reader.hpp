// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "gateway/http/message.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string_view>

namespace gateway {

/// Reads the requests of one connection from the bytes that arrive, one after another. Sans-I/O.
///
/// A request whose end could be disputed is refused, and then the connection has to be closed: one with
/// `Transfer-Encoding`, or with several lengths. So no proxy in front finds other requests in the same bytes.
class request_reader {
  public:
    static constexpr std::size_t longest_head = 16'384;
    static constexpr std::size_t longest_body = 1U << 20U; ///< as long as a line that nodes read
    static constexpr std::size_t most_fields = 100;

    enum class step : std::uint8_t {
        incomplete, ///< more bytes are needed
        head,       ///< the request without its body; told once, before its body is read
        complete,
        refused,
    };

    request_reader();
    request_reader(const request_reader&) = delete;
    request_reader& operator=(const request_reader&) = delete;
    ~request_reader();

    void add(std::string_view bytes);
    [[nodiscard]] step advance();
    /// \pre its head has been told
    [[nodiscard]] http_request& request() noexcept;
    /// \pre it is refused
    [[nodiscard]] const refusal& why() const noexcept;
    /// Begins the next request. \pre the last one is complete
    void next();

    /// Bytes that have not been read yet.
    [[nodiscard]] std::size_t unread() const noexcept;
    /// Whether a part of a request has arrived that is not complete.
    [[nodiscard]] bool has_begun() const noexcept;
    /// Whether its client waits before it sends the body. \pre its head has been told
    [[nodiscard]] bool expects_continue() const noexcept;

  private:
    struct state;
    bool take_head();
    step refuse(int status, const char* message);

    std::unique_ptr<state> state_;
};

} // namespace gateway
