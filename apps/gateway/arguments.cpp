// SPDX-License-Identifier: BSL-1.0
#include "gateway/arguments.hpp"

#include "options/pool_option.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>
#include <CLI/Validators.hpp>

namespace tool {
namespace {

constexpr const char* gateway_examples =
    "Without keys it serves this host, with the rights that anybody on it has. "
    "With keys, each request is for the member\n"
    "whose token it has with it, and the gateway needs the right to forward for "
    "that member. SIGTERM and Ctrl-C stop it.\n\n"
    "Examples:\n"
    "  cles gateway\n"
    "  cles gateway --new-token operator --tokens /var/lib/cles/tokens\n"
    "  cles gateway --keys /var/lib/cles/gateway --tokens /var/lib/cles/tokens\n"
    "  cles gateway --http 0.0.0.0:443 --cert fleet.pem --key fleet.key --tokens "
    "/var/lib/cles/tokens --host fleet.example\n"
    "  cles gateway --behind-proxy --host fleet.example --tokens /var/lib/cles/tokens";

template <class Value>
CLI::Option* add(CLI::App& command, const char* names, Value& to, const char* type, const char* help) {
    return command.add_option(names, to, help)->type_name(type);
}

void add_repeated(CLI::App& command, const char* names, std::vector<std::string>& to, const char* type,
                  const char* help) {
    add(command, names, to, type, help)->expected(1)->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

void add_options_of_http(CLI::App& command, gateway_arguments& given) {
    add_repeated(command, "--http", given.http, "ADDRESS:PORT",
                 "Where HTTP clients are served; port 0: a free port; may be repeated (default 127.0.0.1:25380)");
    add(command, "--cert", given.certificate, "FILE",
        "The certificate for TLS, with those that lead to its authority, in PEM");
    add(command, "--key", given.certificate_key, "FILE", "The private key of the certificate, in PEM");
    command.add_flag("--behind-proxy", given.behind_proxy,
                     "A proxy in front has TLS: allows to serve beyond this host without");
    add_repeated(command, "--host", given.hosts, "NAME",
                 "A name by which clients reach it, besides localhost and addresses; may be repeated");
    add_repeated(command, "--allow-origin", given.origins, "ORIGIN",
                 "Another origin whose pages may use it, as in https://fleet.example; may be repeated");
    add(command, "--tokens", given.tokens, "FILE",
        "The file with the hashes of the tokens that are accepted, of mode 0600");
    add(command, "--new-token", given.new_token, "MEMBER",
        "Only make a token for this member, print it, and add its hash to --tokens");
    add(command, "--connections", given.connections, "N", "How many connections it serves at once (default 1024)")
        ->check(CLI::Range(1, 100'000).description(""));
    add(command, "--connections-per-address", given.connections_per_address, "N",
        "How many of these one address has at most; not behind a proxy (default 128)")
        ->check(CLI::Range(1, 100'000).description(""));
    add(command, "--otlp", given.collector, "URL",
        "A collector of OpenTelemetry for the spans of requests, as in http://127.0.0.1:4318");
}

void add_options_of_node(CLI::App& command, gateway_arguments& given) {
    add(command, "--name,--node", given.name, "NAME",
        "The name of its node (default: that of the key, otherwise gateway)");
    add_pool_option(command, given.pool, "The pool of its node; nodes of other pools are ignored");
    add_repeated(command, "-l,--listen", given.listen, "URL",
                 "A URL at which its node listens; may be repeated (default tcp://127.0.0.1:0, with --keys tls on all "
                 "interfaces)");
    add_repeated(command, "-p,--peer", given.peers, "NAME=URL", "The URL of the node with this name; may be repeated");
    add_repeated(command, "-s,--seed", given.seeds, "URL", "A node to ask for other nodes; may be repeated");
    command.add_flag("--insecure", given.insecure,
                     "Allow links, multicast and NATS beyond this host, where anyone may send any request");
    add(command, "--nats", given.nats, "URL",
        "The URL of a NATS server, through which other pools are reached (needs --pool)");
    add(command, "--nats-credentials", given.nats_credentials, "FILE", "The credentials of a user of NATS");
    given.keys.add_optional_to(command, "The key directory of its node, which then authenticates and encrypts");
    given.multicast.add_to(command, "Interfaces on which it finds nodes by their names");
}

} // namespace

void add_gateway_arguments(CLI::App& command, gateway_arguments& given) {
    command.description("Serve the network to HTTP clients and browsers");
    command.footer(gateway_examples);
    add_options_of_http(command, given);
    add_options_of_node(command, given);
}

} // namespace tool
