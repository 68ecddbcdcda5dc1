// SPDX-License-Identifier: BSL-1.0
#include "serve/node_arguments.hpp"

#include <cles/jobs.hpp>
#include <cles/tracing.hpp>
#include <cles/types.hpp>

#include "client/member_key.hpp"
#include "options/pool_option.hpp"
#include "output/errors.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <unistd.h>

namespace tool {

void node_arguments::add_to(CLI::App& command) {
    command.add_option("--name,--node", name_, "The name of the node (default: " + without_.name_text + ")")
        ->type_name("NAME");
    add_pool_option(command, pool_, "The pool of the node; nodes of other pools are ignored");
    command.add_flag("--allow-clash", allow_clash_, "Continue if another live node had the name first");
    command
        .add_option("-l,--listen", listen_,
                    "A URL to listen at; port 0: a free port; may be repeated (default " + without_.url_text + ")")
        ->type_name("URL")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    command.add_flag("--insecure", insecure_,
                     "Allow listening and multicast beyond this host, where anyone may send any request");
    command
        .add_option("--network", networks_,
                    "Hosts to which UDP replies are not rate-limited, as in 10.0.0.0/8; may be repeated")
        ->type_name("NETWORK")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    keys_.add_optional_to(command, "The key directory of the node, which then authenticates and encrypts");
    multicast_.add_to(command, "Interfaces on which it is found by its name, and publishes updates by multicast");
}

cles::service_options node_arguments::options(const cles::log_sink& log) const {
    cles::service_options options;
    const auto keys = keys_.given_directory();
    if (!keys.empty()) {
        use_member_key(options, keys);
    }
    if (!name_.empty() || keys.empty()) {
        options.name = name_.empty() ? without_.name : name_;
    }
    options.pool = pool_or_variable(pool_);
    options.listen = listen_;
    if (options.listen.empty()) {
        options.listen.push_back(keys.empty() ? without_.url : without_.secured_url);
    }
    for (const auto& where : options.listen) {
        if (where.starts_with("inproc:")) {
            throw usage_error("--listen '" + where + "': it cannot be reached from outside this process");
        }
    }
    options.insecure = insecure_;
    options.networks = networks_;
    options.multicast = multicast_.group(!keys.empty());
    options.tracing = cles::tracing();
    options.types = cles::types();
    options.jobs = cles::jobs();
    options.log = log;
    return options;
}

node_defaults defaults_beside_others() {
    return {.name = "cles-" + std::to_string(::getpid()),
            .name_text = "that of the key, otherwise cles-PID",
            .url = "tcp://127.0.0.1:0",
            .secured_url = "tls://0.0.0.0:0",
            .url_text = "a free port on loopback, with --keys tls on all interfaces"};
}

} // namespace tool
