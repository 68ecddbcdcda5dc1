// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::shell {

class local_node;

/// Where a service's links come in.
class listeners {
  public:
    explicit listeners(local_node& host) noexcept : host_(host) {}

    /// Listens at a URL and returns it as it turned out. \throws cles::error
    std::string listen(std::string_view where, bool insecure);
    /// Opens the ways by which services of the same process and context reach this one without a socket, itself among
    /// them.
    void open_local_doors();
    void close();
    /// Links of other processes come in no more. Sources of datagrams are heard on, so that they can be answered.
    void turn_away();

    /// The door that leads to this service alone.
    [[nodiscard]] std::string self_door() const;
    /// The door behind which services of this context look for a node of that name.
    [[nodiscard]] std::string shared_door(std::string_view name) const;

  private:
    void start(acceptor& made, bool counted);

    local_node& host_;
    std::vector<std::unique_ptr<acceptor>> open_;
    std::vector<std::unique_ptr<acceptor>> doors_; // for this process
};

} // namespace cles::shell
