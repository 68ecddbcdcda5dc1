// SPDX-License-Identifier: BSL-1.0
#include "gateway/settings.hpp"

#include <cles/gossip.hpp>
#include <cles/routing.hpp>
#include <cles/tracing.hpp>
#include <cles/url.hpp>
#ifdef CLES_FEDERATION
#include <cles/federation.hpp>
#endif

#include "client/member_key.hpp"
#include "gateway/http/message.hpp"
#include "options/addresses.hpp"
#include "options/pool_option.hpp"
#include "output/errors.hpp"

#include <boost/asio/ip/address.hpp>
#include <boost/system/system_error.hpp>

#include <string>
#include <string_view>
#include <utility>

namespace gateway {
namespace {

// Updates that wait for one client: 64, and 64 KiB. With more, a slow client would only get older ones.
constexpr std::size_t most_kept_updates = 64;
constexpr std::size_t most_kept_bytes = 65'536;
// Replies for all nodes are long.
constexpr std::size_t longest_line = 8U << 20U;

boost::asio::ip::tcp::endpoint endpoint_of(const std::string& text) {
    try {
        const auto where = cles::parse_url("tcp://" + text);
        if (text.ends_with(":" + std::to_string(where.port))) {
            return {boost::asio::ip::make_address(where.host), where.port};
        }
    } catch (const boost::system::system_error&) { // it is not valid
    }
    throw tool::usage_error("--http '" + text + "': write an address and a port, as in 127.0.0.1:25380 or [::1]:25380");
}

void check_origin_option(const std::string& text) {
    const std::string_view all{text};
    const auto scheme = all.find("://");
    const auto name = scheme == std::string_view::npos ? std::string_view{} : all.substr(scheme + 3);
    const bool is_http = all.starts_with("http://") || all.starts_with("https://");
    if (!is_http || name.empty() || name.find_first_of("/?#, \t") != std::string_view::npos) {
        throw tool::usage_error("--allow-origin '" + text +
                                "': write a scheme and a host, as in https://fleet.example");
    }
}

void add_federation(cles::service_options& to, const tool::gateway_arguments& given) {
    if (given.nats.empty()) {
        return;
    }
    if (to.pool.empty()) {
        throw tool::usage_error("--nats needs the name of the pool: --pool NAME");
    }
#ifdef CLES_FEDERATION
    to.federation = cles::federation({.servers = {given.nats}, .pool = to.pool, .credentials = given.nats_credentials});
#else
    throw tool::usage_error("--nats: this program was built without federation");
#endif
}

} // namespace

http_settings http_settings_of(const tool::gateway_arguments& given) {
    http_settings made;
    const auto texts = given.http.empty() ? std::vector<std::string>{"127.0.0.1:25380"} : given.http;
    bool is_exposed = given.behind_proxy;
    for (const auto& text : texts) {
        made.endpoints.push_back(endpoint_of(text));
        is_exposed = is_exposed || !made.endpoints.back().address().is_loopback();
    }
    made.origins.is_tls = !given.certificate.empty();
    made.origins.is_behind_proxy = given.behind_proxy;
    made.needs_token = !given.tokens.empty();
    if (given.certificate.empty() != given.certificate_key.empty()) {
        throw tool::usage_error("TLS needs both --cert and --key");
    }
    if (is_exposed && !made.origins.is_tls && !given.behind_proxy) {
        throw tool::usage_error("beyond this host, tokens need TLS: give --cert and --key, or --behind-proxy");
    }
    if (is_exposed && !made.needs_token) {
        throw tool::usage_error("beyond this host, anybody could use the network: give --tokens");
    }
    if (!given.keys.given_directory().empty() && !made.needs_token) {
        throw tool::usage_error("with --keys, each request is for a member: give --tokens");
    }
    if (given.behind_proxy && given.hosts.empty()) {
        throw tool::usage_error("--behind-proxy needs the name by which clients reach the proxy: --host NAME");
    }
    for (const auto& host : given.hosts) {
        made.origins.hosts.push_back(small_letters(host));
    }
    for (const auto& text : given.origins) {
        check_origin_option(text);
        made.origins.origins.push_back(small_letters(text));
    }
    return made;
}

cles::service_options node_options_of(const tool::gateway_arguments& given, const cles::log_sink& log) {
    cles::service_options options;
    const auto keys = given.keys.given_directory();
    if (!keys.empty()) {
        tool::use_member_key(options, keys);
    }
    if (!given.name.empty() || keys.empty()) {
        options.name = given.name.empty() ? "gateway" : given.name;
    }
    options.pool = tool::pool_or_variable(given.pool);
    options.listen = given.listen;
    if (options.listen.empty()) {
        options.listen.emplace_back(keys.empty() ? "tcp://127.0.0.1:0" : "tls://0.0.0.0:0");
    }
    for (const auto& text : given.peers) {
        auto [name, url] = tool::named_url(text);
        options.peers.insert_or_assign(std::move(name), std::move(url));
    }
    if (!given.seeds.empty()) {
        options.gossip = cles::gossip(given.seeds);
    }
    options.insecure = given.insecure;
    options.multicast = given.multicast.group(!keys.empty());
    options.routing = cles::routing();
    options.tracing = cles::tracing();
    options.limits.feed = most_kept_updates;
    options.limits.binding_bytes = most_kept_bytes;
    options.limits.line = longest_line;
    options.log = log;
    add_federation(options, given);
    return options;
}

} // namespace gateway
