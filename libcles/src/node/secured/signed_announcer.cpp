// SPDX-License-Identifier: BSL-1.0
#include "node/secured/signed_announcer.hpp"

#include <cles/json_writer.hpp>

#include "node/local_node.hpp"
#include "port/node_security.hpp"
#include "protocol/line.hpp"
#include "protocol/request_line.hpp"

#include <algorithm>
#include <optional>
#include <utility>

namespace cles::core {
namespace {

constexpr std::size_t bytes_of_signature = 91; // with its adverb and the space after it

// The addresses by which others may reach this node.
std::vector<std::string> own_hosts(local_node& host, const std::vector<group_port*>& in_group, bool all) {
    std::vector<std::string> result;
    const auto add = [&](const group_source& source) {
        if (auto text = host_text(source); std::ranges::find(result, text) == result.end()) {
            result.push_back(std::move(text));
        }
    };
    for (const auto* port : in_group) {
        add(port->source());
    }
    if (all) {
        try {
            const auto interfaces = host.environment().interfaces();
            for (const bool loopback : {false, true}) {
                for (const auto& each : interfaces) {
                    if (each.running && each.address != 0 && each.loopback == loopback &&
                        !(loopback && !result.empty())) {
                        add({.address = each.address});
                    }
                }
            }
        } catch (const boost::system::system_error& e) {
            host.post_log(log_level::warning, std::string{"cannot list the interfaces of this host: "} + e.what());
        }
    }
    return result;
}

} // namespace

std::shared_ptr<const signed_announcement> sign_announcement(const announcement& said, std::string_view path,
                                                             std::uint64_t seq, std::string_view epoch,
                                                             const node_security& security) {
    auto made = std::make_shared<signed_announcement>();
    for (auto endpoints = std::min(said.endpoints.size(), max_endpoints);; --endpoints) {
        made->body.clear();
        append_announcement_body(made->body, said, endpoints);
        std::string line;
        protocol::append_update_head(line, said.node, path, seq, epoch);
        if (line.size() + bytes_of_signature + made->body.size() < protocol::datagram_bytes || endpoints == 0) {
            break;
        }
    }
    made->sig = security.sign_update(path, seq, epoch, made->body);
    return made;
}

std::vector<std::string> endpoints_of_interfaces(local_node& host, const std::vector<group_port*>& in_group, bool all) {
    std::vector<std::string> result;
    const auto add = [&](const url& where) {
        if (auto text = to_string(where); std::ranges::find(result, text) == result.end()) {
            result.push_back(std::move(text));
        }
    };
    std::optional<std::vector<std::string>> hosts; // looked up once, and only if they are needed
    for (const auto& endpoint : host.node().endpoints) {
        auto where = parse_url(endpoint);
        if (stays_on_host(where.scheme)) {
            continue;
        }
        if (where.host != "0.0.0.0" && where.host != "::") {
            add(where);
            continue;
        }
        if (where.host == "::") { // IPv6 only, and the addresses are IPv4
            continue;
        }
        if (!hosts) {
            hosts = own_hosts(host, in_group, all);
        }
        for (const auto& own : *hosts) {
            where.host = own;
            add(where);
        }
    }
    return result;
}

std::string signed_announcer::announce(announcement& said, std::uint64_t& seq, bool in_group, bool by_gossip) {
    const bool has_news = by_gossip && host_.peers.has_news(said);
    const bool signs = !last_ || has_news || (in_group && !is_load_enough(said));
    if (signs) {
        said.original = sign_announcement(said, "cles", ++seq, host_.epoch, *host_.security);
        last_ = said;
    } else {
        said.original = last_->original;
    }
    must_sign_ = !signs;
    std::string line;
    if (signs) {
        append_announcement(line, host_.name, *said.original, seq, host_.epoch);
    } else {
        protocol::append_update_head(line, host_.name, load_path, seq, host_.epoch);
        json_writer w{line};
        write_load(w, said.load);
        line.push_back('\n');
    }
    return line;
}

// Not twice in a row, since nodes that have just started know nothing yet of this one. And only if the rest, with the
// number of workers, is the same.
bool signed_announcer::is_load_enough(const announcement& said) const {
    const auto& last = *last_;
    return !must_sign_ && last.node == said.node && last.pool == said.pool && last.endpoints == said.endpoints &&
           last.sources == said.sources && last.interval == said.interval && last.tasks == said.tasks &&
           last.leaving == said.leaving && last.roster == said.roster && last.signed_tasks == said.signed_tasks &&
           last.load.workers == said.load.workers;
}

} // namespace cles::core
