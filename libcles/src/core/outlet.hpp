// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/memory_budget.hpp"

#include <cstddef>
#include <memory>
#include <string>

namespace cles::core {

/// What a session asks of the link that it lives on.
class outlet {
  public:
    outlet() = default;
    outlet(const outlet&) = delete;
    outlet& operator=(const outlet&) = delete;

    /// Lines to send are appended here, LF included.
    virtual std::string& output() = 0;
    /// The same for lines that go before those: the replies to urgent requests.
    virtual std::string& urgent_output() { return output(); }
    /// Bytes of a datagram at most, each of which carries one line with its LF; 0 where it is a stream.
    [[nodiscard]] virtual std::size_t datagram() const noexcept { return 0; }
    /// Something was appended outside of a call that the link made: it is to be sent soon.
    virtual void wake() = 0;
    /// Who answers for the memory that is held for the peer; null where nobody counts.
    [[nodiscard]] virtual std::shared_ptr<memory_account> memory() const { return nullptr; }
    /// Whether so much more output may wait for the peer than waits now, as far as the node's memory goes; it counts
    /// from then on.
    [[nodiscard]] virtual bool reserve(std::size_t /*more*/) { return true; }
    /// The peer does not take what it is sent: what may be left out should be.
    [[nodiscard]] virtual bool is_behind() const = 0;
    /// Stops handing over lines, or goes on.
    virtual void pause(bool stop) = 0;
    /// Sends what is there, then says goodbye and closes.
    virtual void finish() = 0;
    virtual void close() = 0;
    /// The peer answers no more requests: none is to be sent here any more.
    virtual void retire() {}

  protected:
    ~outlet() = default;
};

} // namespace cles::core
