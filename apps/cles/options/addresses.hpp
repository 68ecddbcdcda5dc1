// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/multicast.hpp>

#include "options/keys_option.hpp"

#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace CLI {
class App;
}

namespace tool {

/// Where a node listens by default.
inline constexpr std::string_view default_url = "tcp://127.0.0.1:25370";
/// The same with security.
inline constexpr std::string_view default_secured_url = "tls://127.0.0.1:25370";

/// --multicast: the interfaces and the group to use for multicast. The default is CLES_MULTICAST, and without that the
/// loopback interface, or all of them with security, where the group can be joined.
class multicast_option {
  public:
    /// `help` says what the command uses it for.
    void add_to(CLI::App& command, const std::string& help);

    /// On the command line; the environment does not count.
    [[nodiscard]] bool is_given() const noexcept { return !given_.empty(); }
    [[nodiscard]] const std::string& given() const noexcept { return given_; }
    /// \param saved instead of the default; empty: none was saved. \throws usage_error if it is invalid
    [[nodiscard]] cles::multicast_options group(bool secured, const std::string& saved = {}) const;
    /// Restricts multicast to these of its interfaces; none turns it off.
    void restrict_to(const std::vector<std::string>& interfaces, bool secured, const std::string& saved);

  private:
    std::string given_;
};

/// "lo, eth0"
std::string joined(const std::vector<std::string>& names, const char* separator = ", ");

/// The two parts of the text of --peer, NAME=URL. \throws usage_error if it has another form, or names no node
std::pair<std::string, std::string> named_url(const std::string& text);

struct saved_context;

/// --at, --peer and --multicast: where the command finds the nodes that it talks to. --keys: as whom it does so.
/// --local-user: who may answer at Unix sockets then. --pool: the pool whose nodes it sees. What is given neither as an
/// option nor in the environment is that of the context that is used, if there is one; its addresses count only if none
/// was given.
class address_book {
  public:
    void add_options(CLI::App& command,
                     const std::string& multicast_help = "Interfaces on which nodes are found by their names");

    /// Checks what was given. \throws usage_error
    void check() const;
    /// For commands that list nodes. \throws usage_error if neither multicast nor a node can name them
    void check_discovery() const;

    [[nodiscard]] std::map<std::string, std::string> peers() const;
    /// Without --at and --peer, nodes are found by their announcements, and `self` is at the default address.
    [[nodiscard]] bool finds_by_name() const { return !has_url() && peer_texts().empty() && group().is_on(); }
    /// --at or CLES_AT is set.
    [[nodiscard]] bool has_url() const { return !at().empty(); }
    /// The multicast group, which not every command joins.
    [[nodiscard]] cles::multicast_options group() const;
    /// Restricts multicast to these interfaces; none turns it off.
    void restrict_group_to(const std::vector<std::string>& interfaces);
    /// The pool of this command; empty: the unnamed pool.
    [[nodiscard]] std::string pool() const;
    /// The directory with the key of this command; empty without security.
    [[nodiscard]] std::string keys() const;
    [[nodiscard]] bool is_secured() const { return !keys().empty(); }
    /// Other users of this host, by name or id, and which member each is, as they were given.
    [[nodiscard]] std::vector<std::pair<std::string, std::string>> local_users() const;
    /// Where a node of this host listens by default.
    [[nodiscard]] std::string_view default_node() const { return is_secured() ? default_secured_url : default_url; }
    /// --multicast was given.
    [[nodiscard]] bool has_group() const noexcept { return multicast_.is_given(); }
    /// The URL to which requests for this node are sent; empty if it is one of the peers, or found by its name.
    /// \throws cles::error with `no_target`
    [[nodiscard]] std::string url_for(std::string_view node) const;
    /// The same, but with the URL of a peer; empty if it is found by its name.
    [[nodiscard]] std::string endpoint_of(std::string_view node) const;

    /// --at was given; CLES_AT does not count.
    [[nodiscard]] bool has_at() const noexcept { return !at_.empty(); }
    /// For a command whose argument is a URL or the name of a node: a URL becomes --at.
    /// \return the noun that describes the node, "car1:cles". \throws usage_error if the argument is neither
    std::string use_target(const std::string& target);

    /// What was given as options, to be saved.
    [[nodiscard]] saved_context given() const;
    /// These options are to be a context of their own: neither that which is used counts, nor CLES_AT.
    void leave_context() noexcept { is_in_context_ = false; }

  private:
    [[nodiscard]] std::string at() const;
    [[nodiscard]] const std::vector<std::string>& peer_texts() const;
    /// The context that is used; empty if there is none.
    [[nodiscard]] const saved_context& saved() const;
    /// Whether no address was given, so that those of the context count.
    [[nodiscard]] bool uses_saved_addresses() const;
    void check_url(const std::string& text) const;

    std::string at_;
    std::vector<std::string> peers_;
    std::vector<std::string> local_users_;
    multicast_option multicast_;
    keys_option keys_;
    std::string pool_;
    bool is_in_context_ = true;
};

} // namespace tool
