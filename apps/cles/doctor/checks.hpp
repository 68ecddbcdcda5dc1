// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include "doctor/finding.hpp"

#include <boost/asio/awaitable.hpp>

#include <string>
#include <vector>

namespace tool {

class address_book;
class client;

// Each looks at one thing and adds what it found.

/// Whether `clesd` could be started with the configuration that it would use, by its own word.
void check_config(findings& found);

/// The interfaces of this host, and those that multicast is to go by.
void check_interfaces(const cles::multicast_options& where, findings& found);

/// Sends a word to the group by each interface and listens for it. \return by which it was heard
std::vector<std::string> check_multicast(const cles::multicast_options& where, findings& found);

/// Whether the ports that nodes use unless something else is said are free, or theirs; with --at, who is there.
boost::asio::awaitable<void> check_ports(client& asker, const address_book& addresses, findings& found);

/// Whether the nodes that can be heard can also be asked, whether their names are their own, and what time they have.
boost::asio::awaitable<void> check_nodes(client& asker, const address_book& addresses, findings& found);

/// The clock of this host.
void check_clock(findings& found);

/// How many files, and so links, a program may have open.
void check_limits(findings& found);

} // namespace tool
