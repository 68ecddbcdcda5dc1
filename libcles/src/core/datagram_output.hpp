// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "core/node.hpp"

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>

namespace cles::core {

/// What may leave a node by datagram to one source: no update that is too large, and to a stranger not more than his
/// share.
class datagram_output {
  public:
    /// `stranger`: the address whose share it is (docs/protocol.md, "Reflection"); empty where there is no limit.
    datagram_output(node& host, std::size_t longest, std::string stranger, std::size_t headers)
        : node_(host), longest_(longest), stranger_(std::move(stranger)), headers_(headers) {}

    /// Appends updates, but for those that do not fit: the binder sees them as gaps.
    void append_updates(std::string& out, std::string_view lines);
    /// Takes out what a stranger may not get just now. To be called once for what is appended.
    void limit(std::string& out, time_point now);

  private:
    node& node_;
    std::size_t longest_;
    std::string stranger_;
    std::size_t headers_; // bytes that the network adds to each datagram
};

} // namespace cles::core
