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

/// What to do if a node denies this key what the checks ask.
inline constexpr const char* advice_on_denial =
    "permit it at the fleet's authority (cles fleet rights NAME --may LIST); cles access says which line decides";

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

/// What the key directory of the command is good for.
struct checked_key {
    bool is_usable = true;
    bool may_ask_group = true; ///< whether there may be a member that answers it there
};
/// The key directory of the command, unless its name is empty.
checked_key check_keys(const std::string& directory, findings& found);

/// The interfaces of this host, and those that multicast uses. `secured`: nodes are to have security.
void check_interfaces(const cles::multicast_options& group, bool secured, findings& found);

/// Sends a datagram to the group on each interface, and waits for it. \return the interfaces on which it was received
std::vector<std::string> check_multicast(const cles::multicast_options& group, findings& found);

/// Whether the default ports of nodes are free, or used by nodes; with --at, which node is there.
/// \return the address of a node that was found so; empty if there is none
boost::asio::awaitable<std::string> check_ports(client& requester, const address_book& addresses, findings& found);

/// What earlier checks found that tells why no node announces itself.
struct known_before {
    bool nobody_listens = false; ///< to the group, which is on loopback only
    bool may_ask_group = true;   ///< what `check_keys` returned
    std::string at_port{};       ///< what `check_ports` returned
};

/// Whether the nodes that announce themselves answer, have unique names, the same roster, and the time of this host.
boost::asio::awaitable<void> check_nodes(client& requester, const address_book& addresses, const known_before& known,
                                         findings& found);

/// Of the nodes that are bridges to other pools: whether they are connected to NATS, how long a message takes there and
/// back, and whether the pools can be reached.
boost::asio::awaitable<void> check_federation(client& requester, const std::vector<listed_node>& nodes,
                                              findings& found);

/// The clock of this host.
void check_clock(findings& found);

/// The number of files, and therefore links, that a program may open.
void check_limits(findings& found);

} // namespace tool
