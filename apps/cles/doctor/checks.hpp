// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include <boost/asio/awaitable.hpp>

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace tool {

class address_book;
class client;
struct listed_node;

/// How long a check waits for a node's answer.
inline constexpr std::chrono::seconds query_timeout{1};

enum class verdict : std::uint8_t { ok, warning, failure };

/// What a check of `cles doctor` found.
struct finding {
    std::string_view check; ///< its name: "ports"
    verdict how = verdict::ok;
    std::string text;
    std::string advice; ///< what to do about it
};

/// Collects the findings of all checks.
class findings {
  public:
    void ok(std::string_view check, std::string text, std::string advice = {}) {
        all_.push_back({check, verdict::ok, std::move(text), std::move(advice)});
    }
    void warning(std::string_view check, std::string text, std::string advice = {}) {
        all_.push_back({check, verdict::warning, std::move(text), std::move(advice)});
    }
    void failure(std::string_view check, std::string text, std::string advice = {}) {
        all_.push_back({check, verdict::failure, std::move(text), std::move(advice)});
    }

    [[nodiscard]] const std::vector<finding>& all() const noexcept { return all_; }

  private:
    std::vector<finding> all_;
};

/// Whether `clesd` accepts the configuration that it would use, which it checks itself.
void check_configuration(findings& found);

/// The key directory of the command, unless its name is empty. \return whether it can be used
bool check_keys(const std::string& directory, findings& found);

/// The interfaces of this host, and those that multicast uses.
void check_interfaces(const cles::multicast_options& group, findings& found);

/// Sends a datagram to the group on each interface, and waits for it. \return the interfaces on which it was received
std::vector<std::string> check_multicast(const cles::multicast_options& group, findings& found);

/// Whether the default ports of nodes are free, or used by nodes; with --at, which node is there.
boost::asio::awaitable<void> check_ports(client& requester, const address_book& addresses, findings& found);

/// Whether the nodes that announce themselves answer, have unique names, the same roster, and the time of this host.
boost::asio::awaitable<void> check_nodes(client& requester, const address_book& addresses, findings& found);

/// Of the nodes that are bridges to other pools: whether they are connected to NATS, how long a message takes there and
/// back, and whether the pools can be reached.
boost::asio::awaitable<void> check_federation(client& requester, const std::vector<listed_node>& nodes,
                                              findings& found);

/// The clock of this host.
void check_clock(findings& found);

/// The number of files, and therefore links, that a program may open.
void check_limits(findings& found);

} // namespace tool
