// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>

#include "federation/bridge_link.hpp"

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cles::bridging {

/// What a bridge does outside itself. Of it, only `deliver` to a link that it opens calls the bridge: `on_closed`, if
/// the node refuses the link.
class bridge_output {
  public:
    bridge_output() = default;
    bridge_output(const bridge_output&) = delete;
    bridge_output& operator=(const bridge_output&) = delete;

    enum class room : std::uint8_t {
        shared,  ///< of requests, replies and updates
        reserved ///< for short messages without which others would wait in vain: failures, control, heartbeats
    };
    /// Returns false if too much waits already.
    virtual bool publish(std::string subject, std::string reply, std::string message, room in) = 0;
    /// \param shared one bridge of the pool receives each message
    virtual void subscribe(std::string subject, bool shared) = 0;
    virtual void unsubscribe(const std::string& subject) = 0;

    /// A line for the node, without LF. Opens the link if it is not `to_pool` and not open.
    virtual void deliver(const bridge_link& on, std::string line) = 0;
    /// No line follows on that link. The bridge is not told when it has closed.
    virtual void end(const bridge_link& which) = 0;
    /// The links to and from that pool are lost.
    virtual void lose_pool(std::string_view pool, std::string_view why) = 0;
    virtual void lose_all(std::string_view why) = 0;
    /// The binding of that noun on the link is lost.
    virtual void lose_binding(const bridge_link& on, const std::string& noun, std::string_view why) = 0;
    /// There are other pools, or other nodes in them.
    virtual void on_pools_changed() = 0;

    /// The names of the nodes of the own pool, this one included.
    [[nodiscard]] virtual std::vector<std::string> home_names() const = 0;
    virtual void log(log_level level, const std::string& text) = 0;

  protected:
    ~bridge_output() = default;
};

} // namespace cles::bridging
