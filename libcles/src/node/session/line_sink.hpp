// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "node/base/memory_budget.hpp"

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

namespace cles::core {

/// What a session needs of its link.
class line_sink {
  public:
    line_sink() = default;
    line_sink(const line_sink&) = delete;
    line_sink& operator=(const line_sink&) = delete;

    /// Lines to send are appended here, LF included.
    virtual std::string& output() = 0;
    /// The same for lines that precede those: replies to urgent requests.
    virtual std::string& urgent_output() { return output(); }
    /// The maximum size in bytes of a datagram, which holds one line with its LF; 0 for a stream.
    [[nodiscard]] virtual std::size_t datagram() const noexcept { return 0; }
    [[nodiscard]] bool is_datagram() const noexcept { return datagram() != 0; }
    /// Output was appended outside a callback of the link: it must be sent soon.
    virtual void wake() = 0;
    /// The account for memory held on the peer's behalf; null if it is not counted.
    [[nodiscard]] virtual std::shared_ptr<memory_account> memory() const { return nullptr; }
    /// Reserves memory for this many bytes of output beyond those that wait now. False if the node has none.
    [[nodiscard]] virtual bool reserve(std::size_t /*more*/) { return true; }
    /// Whether the peer reads too slowly: optional output should be skipped.
    [[nodiscard]] virtual bool is_behind() const = 0;
    /// Stops or resumes the delivery of lines.
    virtual void pause(bool stop) = 0;
    /// Sends the pending output, then shuts down and closes the link.
    virtual void finish() = 0;
    virtual void close() = 0;
    /// The peer answers no more requests: none may be sent here.
    virtual void retire() {}
    /// A request is sent again: see `link::check_peer`.
    virtual void check_peer(time_point /*since*/) {}
    /// The peer has answered a `PULL self:cles` with this valid JSON.
    virtual void on_described(std::string_view /*json*/) {}

  protected:
    ~line_sink() = default;
};

} // namespace cles::core
