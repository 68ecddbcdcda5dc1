// SPDX-License-Identifier: BSL-1.0
#include "options/addresses.hpp"

#include <cles/error.hpp>
#include <cles/link.hpp>
#include <cles/url.hpp>

#include "options/arguments.hpp"
#include "options/pool_option.hpp"
#include "options/saved_contexts.hpp"
#include "output/errors.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <cstdlib>

namespace tool {
namespace {

cles::multicast_options parse_group(const std::string& text, const std::string& source) {
    try {
        return cles::parse_multicast(text);
    } catch (const cles::error& e) {
        throw usage_error(source + ": " + e.message());
    }
}

// Of texts such as "car1=tcp://127.0.0.1:25370".
std::vector<std::pair<std::string, std::string>> pairs_of(const std::vector<std::string>& texts) {
    std::vector<std::pair<std::string, std::string>> out;
    for (const auto& text : texts) {
        const auto equals = text.find('=');
        out.emplace_back(text.substr(0, equals), text.substr(equals + 1));
    }
    return out;
}

} // namespace

void multicast_option::add_to(CLI::App& command, const std::string& help) {
    command
        .add_option_function<std::string>(
            "-m,--multicast",
            [this](const std::string& text) {
                parse_group(text, "--multicast");
                given_ = text;
            },
            help + " (default CLES_MULTICAST, otherwise lo; auto with --keys)")
        ->type_name("IFACE[,IFACE...][,GROUP[:PORT]]|auto|off");
}

cles::multicast_options multicast_option::group(bool secured, const std::string& saved) const {
    if (is_given()) {
        return parse_group(given_, "--multicast");
    }
    if (const char* variable = std::getenv("CLES_MULTICAST"); variable != nullptr && *variable != '\0') {
        return parse_group(variable, "CLES_MULTICAST");
    }
    if (!saved.empty()) {
        return parse_group(saved, "the multicast of the context");
    }
    cles::multicast_options wanted{.interface = secured ? "auto" : "lo"};
    wanted.required = false;
    return wanted;
}

void multicast_option::restrict_to(const std::vector<std::string>& interfaces, bool secured, const std::string& saved) {
    const auto all = group(secured, saved);
    given_ = interfaces.empty() ? "off" : joined(interfaces, ",") + "," + all.group + ":" + std::to_string(all.port);
}

std::string joined(const std::vector<std::string>& names, const char* separator) {
    std::string all;
    for (const auto& name : names) {
        all.append(all.empty() ? "" : separator).append(name);
    }
    return all;
}

std::pair<std::string, std::string> named_url(const std::string& text) {
    const auto equals = text.find('=');
    if (equals == std::string::npos || !is_name(text.substr(0, equals))) {
        throw usage_error("--peer '" + text + "': write NAME=URL, as in car1=tcp://127.0.0.1:25370");
    }
    auto name = text.substr(0, equals);
    if (stands_for_others(name)) {
        throw usage_error("--peer '" + text + "': " + name + " is not the name of a node");
    }
    return {std::move(name), text.substr(equals + 1)};
}

void address_book::add_options(CLI::App& command, const std::string& multicast_help) {
    auto* at =
        command.add_option("-a,--at", at_,
                           "The URL of the node (default CLES_AT; otherwise it is found by its name, and self is " +
                               std::string{default_url} + ")");
    at->type_name("URL");
    auto* peer = command.add_option("-p,--peer", peers_, "The URL of the node with this name; may be repeated");
    peer->type_name("NAME=URL")->expected(1)->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    multicast_.add_to(command, multicast_help);
    keys_.add_optional_to(command, "The key directory of a member of the fleet, as which secured nodes are reached");
    auto* user =
        command.add_option("--local-user", local_users_,
                           "With --keys, which member a user is, besides root and you, who listens at the Unix "
                           "socket of --at or --peer; may be repeated");
    user->type_name("USER=MEMBER")->expected(1)->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    add_pool_option(command, pool_, "The pool of this command, which sees no nodes of others");
}

const saved_context& address_book::saved() const {
    static const saved_context none{};
    return is_in_context_ ? used_context() : none;
}

bool address_book::uses_saved_addresses() const {
    const char* variable = std::getenv("CLES_AT");
    return is_in_context_ && at_.empty() && peers_.empty() && (variable == nullptr || *variable == '\0');
}

std::string address_book::at() const {
    if (uses_saved_addresses()) {
        return saved().at;
    }
    const char* variable = std::getenv("CLES_AT");
    return is_in_context_ && at_.empty() && variable != nullptr ? variable : at_;
}

const std::vector<std::string>& address_book::peer_texts() const {
    return uses_saved_addresses() ? saved().peers : peers_;
}

cles::multicast_options address_book::group() const { return multicast_.group(is_secured(), saved().multicast); }

void address_book::restrict_group_to(const std::vector<std::string>& interfaces) {
    multicast_.restrict_to(interfaces, is_secured(), saved().multicast);
}

std::string address_book::pool() const {
    const auto chosen = pool_or_variable(pool_);
    return chosen.empty() ? saved().pool : chosen;
}

std::string address_book::keys() const {
    const auto directory = keys_.given_directory();
    return directory.empty() ? saved().keys : directory;
}

saved_context address_book::given() const {
    return {.at = at_,
            .peers = peers_,
            .keys = keys_.given(),
            .local_users = local_users_,
            .multicast = multicast_.given(),
            .pool = pool_};
}

void address_book::check_url(const std::string& text) const {
    const auto scheme = cles::parse_url(text).scheme;
    if (scheme == "tls") {
        if (!is_secured()) {
            throw usage_error("'" + text + "' " + keys_needed);
        }
    } else if (cles::find_transport(scheme) == nullptr) {
        throw usage_error("'" + text + "': there is no transport " + scheme);
    } else if ((scheme == "tcp" || scheme == "udp") && is_secured()) {
        throw usage_error("'" + text + "' is refused with --keys: write tls://" +
                          text.substr(text.find("://") + std::string_view{"://"}.size()));
    }
}

void address_book::check() const {
    if (const auto url = at(); !url.empty()) {
        check_url(url);
    }
    for (const auto& peer : peer_texts()) {
        check_url(named_url(peer).second);
    }
    for (const auto& user : local_users_) {
        const auto equals = user.find('=');
        if (equals == std::string::npos || equals == 0 || !is_name(user.substr(equals + 1))) {
            throw usage_error("--local-user '" + user + "': write USER=MEMBER, as in cles=car1");
        }
        if (!is_secured()) {
            throw usage_error("--local-user '" + user + "' " + keys_needed);
        }
    }
}

void address_book::check_discovery() const {
    if (!finds_by_name() && !has_url()) {
        throw usage_error("no nodes are found without multicast: select an interface with --multicast IFACE, or ask a "
                          "node for those that it knows with --at URL");
    }
}

std::map<std::string, std::string> address_book::peers() const {
    std::map<std::string, std::string> out;
    for (auto& [name, url] : pairs_of(peer_texts())) {
        out.insert_or_assign(std::move(name), std::move(url));
    }
    return out;
}

std::vector<std::pair<std::string, std::string>> address_book::local_users() const {
    const bool is_saved_key = keys_.given_directory().empty();
    return pairs_of(local_users_.empty() && is_saved_key ? saved().local_users : local_users_);
}

std::string address_book::url_for(std::string_view node) const {
    if (peers().contains(std::string{node})) {
        return {};
    }
    const auto url = at();
    if (url.empty() && !peer_texts().empty()) {
        throw cles::error(cles::errc::no_target, "there is no --peer '" + std::string{node} + "', and no --at");
    }
    if (finds_by_name() && !stands_for_others(node)) {
        return {};
    }
    return url.empty() ? std::string{default_node()} : url;
}

std::string address_book::endpoint_of(std::string_view node) const {
    const auto known = peers();
    const auto peer = known.find(std::string{node});
    return peer != known.end() ? peer->second : url_for(node);
}

std::string address_book::use_target(const std::string& target) {
    const bool is_url = target.find("://") != std::string::npos;
    if (!is_url && !is_name(target)) {
        throw usage_error("'" + target + "' is neither the name of a node nor a URL such as tcp://10.0.0.7:25370");
    }
    if (is_url) {
        at_ = target;
    }
    return (is_url ? "self" : target) + ":cles";
}

} // namespace tool
