// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/log.hpp>
#include <cles/service.hpp>

#include "options/addresses.hpp"
#include "options/keys_option.hpp"

#include <string>
#include <utility>
#include <vector>

namespace CLI {
class App;
}

namespace tool {

/// What a command that runs a node uses without an option, and how its help says so.
struct node_defaults {
    std::string name;
    std::string name_text;
    std::string url;
    std::string secured_url;
    std::string url_text;
};

/// The options of commands that run a node: its name, where it listens, its key, its pool and its network.
class node_arguments {
  public:
    explicit node_arguments(node_defaults without) : without_(std::move(without)) {}

    void add_to(CLI::App& command);
    /// The name unless --name was given.
    void propose_name(const std::string& name) { name_ = name_.empty() ? name : name_; }
    [[nodiscard]] bool allows_clash() const noexcept { return allow_clash_; }
    /// The options of the service. \throws usage_error, and std::runtime_error if the key cannot be used
    [[nodiscard]] cles::service_options options(const cles::log_sink& log) const;

  private:
    node_defaults without_;
    std::string name_;
    keys_option keys_;
    std::string pool_;
    bool allow_clash_ = false;
    std::vector<std::string> listen_;
    bool insecure_ = false;
    std::vector<std::string> networks_;
    multicast_option multicast_;
};

/// The defaults of commands that run a node beside others: a name of its own, and a free port.
node_defaults defaults_beside_others();

} // namespace tool
